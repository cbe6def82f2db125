#include <Eigen/LU>
#include <vector>

#include "cairn/geometry/epipolar.h"
#include "cairn/solvers/eight_point.h"
#include "cairn/solvers/homography.h"
#include "math/random_vectors.h"
#include "support/random_two_view.h"
#include "support/test.h"

namespace cairn {
namespace {

std::vector<PointCorrespondence> PointsOf(const TwoViewScene& scene) {
  std::vector<PointCorrespondence> points;
  for (const auto& patch : scene.patches) points.push_back(patch.points());
  return points;
}

// Points of one plane seen by both cameras, and the homography they follow.
struct PlaneScene {
  Rigid3d cam2_from_cam1;
  Eigen::Vector3d normal;
  double distance;
  std::vector<PointCorrespondence> points;
  Eigen::Matrix3d H() const {
    return cam2_from_cam1.RotationMatrix() +
           cam2_from_cam1.translation * normal.transpose() / distance;
  }
};

PlaneScene RandomPlane(Rng& rng, int num_points) {
  PlaneScene scene;
  const Eigen::Vector3d translation = RandomOfLength(0.1, 1.0, rng);
  scene.cam2_from_cam1 = Rigid3d(ExpSO3(RandomOfLength(0.0, 0.5, rng)), translation);
  scene.normal =
      Eigen::Vector3d(UniformVector({{-0.4, 0.4}, {-0.4, 0.4}}, rng).homogeneous()).normalized();
  scene.distance = rng.Uniform(3.0, 6.0);
  while (static_cast<int>(scene.points.size()) < num_points) {
    const Eigen::Vector3d ray = UniformVector({{-0.5, 0.5}, {-0.5, 0.5}}, rng).homogeneous();
    const Eigen::Vector3d X2 =
        scene.cam2_from_cam1 * Eigen::Vector3d(ray * (scene.distance / scene.normal.dot(ray)));
    scene.points.push_back({ray.hnormalized(), X2.hnormalized()});
  }
  return scene;
}

TEST(EightPoint, IsExactFromEightPointsOn) {
  Rng rng(1);
  for (const int n : {8, 9, 50}) {
    for (int trial = 0; trial < 100; ++trial) {
      const TwoViewScene scene = RandomScene(rng, n);
      const Eigen::Matrix3d truth = EssentialFromPose(scene.cam2_from_cam1);
      Eigen::Matrix3d F;
      ASSERT_TRUE(FundamentalFromEightPoints(PointsOf(scene), &F));
      EXPECT_LT(HomogeneousError(F, truth), 1e-5);
      EXPECT_NEAR(F.determinant(), 0.0, 1e-12);
    }
  }
}

TEST(EightPoint, RefusesTooFewOrCoincidentPoints) {
  Rng rng(2);
  Eigen::Matrix3d F;
  EXPECT_FALSE(FundamentalFromEightPoints(PointsOf(RandomScene(rng, 7)), &F));
  EXPECT_FALSE(FundamentalFromEightPoints(std::vector<PointCorrespondence>(10), &F));
}

TEST(Homography, FourPointsAndLeastSquaresAreExact) {
  Rng rng(3);
  for (int trial = 0; trial < 500; ++trial) {
    const PlaneScene scene = RandomPlane(rng, 20);
    Eigen::Matrix3d H;
    ASSERT_EQ(HomographyFourPoint::Solve(scene.points.data(), &H), 1);
    EXPECT_LT(HomogeneousError(H, scene.H()), 1e-6);
    ASSERT_TRUE(HomographyFromPoints(scene.points, &H));
    EXPECT_LT(HomogeneousError(H, scene.H()), 1e-9);
  }
}

TEST(Homography, RejectsCollinearAndFoldedSamples) {
  PointCorrespondence s[4] = {
      {{0, 0}, {0, 0}}, {{1, 1}, {1, 1}}, {{2, 2}, {2, 2}}, {{0, 1}, {0, 1}}};
  Eigen::Matrix3d H;
  EXPECT_EQ(HomographyFourPoint::Solve(s, &H), 0);
  PointCorrespondence folded[4] = {
      {{0, 0}, {0, 0}}, {{1, 0}, {1, 0}}, {{1, 1}, {1, 1}}, {{0, 1}, {2, -1}}};
  EXPECT_EQ(HomographyFourPoint::Solve(folded, &H), 0);
}

TEST(DecomposeHomography, ContainsTheTruth) {
  Rng rng(4);
  for (int trial = 0; trial < 500; ++trial) {
    const PlaneScene scene = RandomPlane(rng, 1);
    PlaneMotion motions[4];
    const int count = DecomposeHomography(-2.5 * scene.H(), motions);
    ASSERT_EQ(count, 4);
    double best = 1e300;
    for (const PlaneMotion& motion : motions) {
      EXPECT_NEAR(motion.normal.norm(), 1.0, 1e-9);
      EXPECT_LT(HomogeneousError(motion.cam2_from_cam1.RotationMatrix() +
                                     motion.cam2_from_cam1.translation * motion.normal.transpose(),
                                 scene.H()),
                1e-6);
      best = std::min(best, PoseError(motion.cam2_from_cam1, scene.cam2_from_cam1));
    }
    EXPECT_LT(best, 1e-6);
  }
}

TEST(DecomposeHomography, RecognizesARotation) {
  Rng rng(5);
  const Eigen::Quaterniond R = ExpSO3(0.3 * RandomDirection(rng));
  PlaneMotion motions[4];
  ASSERT_EQ(DecomposeHomography(-3.0 * R.toRotationMatrix(), motions), 1);
  EXPECT_LT(AngleBetween(motions[0].cam2_from_cam1.rotation, R), 1e-9);
  EXPECT_TRUE(motions[0].cam2_from_cam1.translation.isZero());
  Eigen::Matrix3d singular = Eigen::Matrix3d::Identity();
  singular(2, 2) = 0.0;
  EXPECT_EQ(DecomposeHomography(singular, motions), 0);
}

}  // namespace
}  // namespace cairn
