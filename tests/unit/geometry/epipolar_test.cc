#include "cairn/geometry/epipolar.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

Eigen::Vector3d RandomVector(Rng& rng) { return {rng.Gaussian(), rng.Gaussian(), rng.Gaussian()}; }

// A pose with points in front of both cameras.
struct Problem {
  Rigid3d cam2_from_cam1;
  std::vector<Eigen::Vector3d> points1, points2;  // in the cameras
  std::vector<Eigen::Vector2d> x1, x2;

  explicit Problem(uint64_t seed) {
    Rng rng(seed);
    cam2_from_cam1 = {ExpSO3(0.3 * RandomVector(rng)), 0.5 * RandomVector(rng)};
    while (x1.size() < 20) {
      const Eigen::Vector3d p1 = RandomVector(rng) + Eigen::Vector3d(0, 0, 5);
      const Eigen::Vector3d p2 = cam2_from_cam1 * p1;
      if (p1.z() < 1 || p2.z() < 1) continue;
      points1.push_back(p1);
      points2.push_back(p2);
      x1.push_back(p1.hnormalized());
      x2.push_back(p2.hnormalized());
    }
  }
};

TEST(Epipolar, EssentialMatrixAnnulsTruePoints) {
  for (int seed = 0; seed < 50; ++seed) {
    const Problem p(seed);
    const Eigen::Matrix3d E = EssentialFromPose(p.cam2_from_cam1);
    EXPECT_NEAR(E.norm(), std::sqrt(2.0), 1e-14);
    for (size_t i = 0; i < p.x1.size(); ++i) {
      EXPECT_NEAR(p.x2[i].homogeneous().dot(E * p.x1[i].homogeneous()), 0, 1e-14);
      EXPECT_LT(SquaredSampsonError(E, p.x1[i], p.x2[i]), 1e-28);
    }
  }
}

TEST(Epipolar, OneOfTheFourPosesIsTheTruthAndCheiralitySelectsIt) {
  for (int seed = 0; seed < 50; ++seed) {
    const Problem p(seed);
    const double scale = seed % 2 ? -2.5 : 0.3;
    const Eigen::Matrix3d E = scale * EssentialFromPose(p.cam2_from_cam1);
    for (const Rigid3d& pose : PosesFromEssential(E)) {
      EXPECT_NEAR(pose.translation.norm(), 1, 1e-13);
      EXPECT_NEAR(pose.RotationMatrix().determinant(), 1, 1e-13);
      const Eigen::Matrix3d again = EssentialFromPose(pose);
      const double sign = again.cwiseProduct(E).sum() > 0 ? 1 : -1;
      EXPECT_LT((sign * again * std::abs(scale) - E).norm(), 1e-12);
    }
    const CheiralityResult best = SelectPoseByCheirality(E, p.points1, p.points2);
    EXPECT_EQ(best.num_in_front, 20);
    EXPECT_LT(AngleBetween(best.cam2_from_cam1.rotation, p.cam2_from_cam1.rotation), 1e-12);
    EXPECT_LT(AngleBetween(best.cam2_from_cam1.translation, p.cam2_from_cam1.translation), 1e-12);
  }
}

TEST(NearestEssential, IsIdempotentAndFixesSingularValues) {
  const Eigen::Matrix3d E = NearestEssential(Eigen::Matrix3d::Random());
  EXPECT_LT((NearestEssential(E) - E).norm(), 1e-12);
  EXPECT_NEAR(E.squaredNorm(), 2.0, 1e-12);
}

TEST(Epipolar, FundamentalMatrixAnnulsPixels) {
  const Problem p(1);
  Eigen::Matrix3d K1, K2;
  K1 << 800, 0, 500, 0, 810, 380, 0, 0, 1;
  K2 << 1200, 0, 640, 0, 1190, 470, 0, 0, 1;
  const Eigen::Matrix3d F = FundamentalFromEssential(EssentialFromPose(p.cam2_from_cam1), K1, K2);
  for (size_t i = 0; i < p.x1.size(); ++i) {
    const Eigen::Vector3d u1 = K1 * p.x1[i].homogeneous(), u2 = K2 * p.x2[i].homogeneous();
    EXPECT_NEAR(u2.dot(F * u1), 0, 1e-10);
  }
}

// For small displacements it is the distance to the nearest pair of points that fits exactly.
TEST(Epipolar, SampsonErrorIsTheDistanceToTheNearestExactPair) {
  Rng rng(5);
  for (int seed = 0; seed < 50; ++seed) {
    const Problem p(seed);
    const Eigen::Matrix3d E = EssentialFromPose(p.cam2_from_cam1);
    const Eigen::Vector2d x1 = p.x1[0] + 1e-4 * GaussianVector<2>(rng);
    const Eigen::Vector2d x2 = p.x2[0] + 1e-4 * GaussianVector<2>(rng);
    // Gradient of the constraint over (x1, x2): the exact pair lies along it.
    Eigen::Vector4d gradient;
    gradient << (E.transpose() * x2.homogeneous()).head<2>(), (E * x1.homogeneous()).head<2>();
    const double value = x2.homogeneous().dot(E * x1.homogeneous());
    const double squared_error = SquaredSampsonError(E, x1, x2);
    EXPECT_NEAR(squared_error, value * value / gradient.squaredNorm(), 1e-18);
    const Eigen::Vector4d step = -value / gradient.squaredNorm() * gradient;
    EXPECT_NEAR(step.squaredNorm(), squared_error, 1e-18);
    EXPECT_LT(SquaredSampsonError(E, x1 + step.head<2>(), x2 + step.tail<2>()),
              1e-4 * squared_error + 1e-24);
  }
  EXPECT_EQ(SquaredSampsonError(Eigen::Matrix3d::Zero(), {0, 0}, {0, 0}), 0);
}

TEST(CheiralityTest, TellsBehindFromInFrontAndForgivesFarPoints) {
  const Rigid3d sideways(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 0, 0));
  const CheiralityTest strict(sideways), tolerant(sideways, 0.02);
  const Eigen::Vector3d ray(0.1, 0.2, 1);
  EXPECT_FALSE(strict.IsInFront(ray, ray));
  EXPECT_TRUE(tolerant.IsInFront(ray, ray));
  EXPECT_FALSE(tolerant.IsInFront(ray, -ray));
  // Points move to the right in the second image: those that move to the left meet behind.
  for (const double shift : {0.01, 0.1}) {
    EXPECT_TRUE(strict.IsInFront({0, 0, 1}, {shift, 0, 1}));
    EXPECT_TRUE(tolerant.IsInFront({0, 0, 1}, {3 * shift, 0, 3}));
    EXPECT_FALSE(strict.IsInFront({shift, 0, 1}, {0, 0, 1}));
    EXPECT_EQ(tolerant.IsInFront({shift, 0, 1}, {0, 0, 1}), shift < 0.02);
  }
}

// Rays in any direction: beside and behind the cameras, too.
TEST(Rays, Cheirality) {
  Rng rng(7);
  const Rigid3d pose(ExpSO3(Eigen::Vector3d(0.3, -1.2, 0.4)), Eigen::Vector3d(0.6, 0.0, -0.8));
  const Eigen::Matrix3d E = EssentialFromPose(pose);
  std::vector<Eigen::Vector3d> rays1, rays2;
  for (int i = 0; i < 100; ++i) {
    const double scale = rng.Uniform(2, 5);
    const Eigen::Vector3d x1 = scale * GaussianVector<3>(rng);
    const Eigen::Vector3d x2 = pose * x1;
    rays1.push_back(x1.normalized());
    rays2.push_back(x2.normalized());
    EXPECT_TRUE(CheiralityTest(pose).IsInFront(2 * x1, rays2[i]));
  }
  const CheiralityResult best = SelectPoseByCheirality(E, rays1, rays2);
  EXPECT_EQ(best.num_in_front, 100);
  EXPECT_LT((best.cam2_from_cam1.translation - pose.translation).norm(), 1e-9);
}

}  // namespace
}  // namespace cairn
