// Fundamental matrices of scenes that a plane dominates.
#include "two_view/search/fundamental_resampling.h"

#include "cairn/math/angles.h"
#include "math/random_vectors.h"
#include "robust/fundamental_refinement.h"
#include "robust/match_errors.h"
#include "support/test.h"
#include "unit/two_view/pair_fixture.h"

namespace cairn::internal {
namespace {

// 200 points of a plane and 40 in front of it, whose right matches are the scene's only parallax;
// cameras of 1000 px, to which E is F of normalized points.
struct NearPlanar {
  explicit NearPlanar(uint64_t seed) {
    Rng rng(seed, "near planar");
    const Eigen::Vector2d aside = UniformVector({{-0.3, 0.3}, {-0.3, 0.3}}, rng);
    const Rigid3d motion(ExpSO3(RandomOfLength(0.1, 0.3, rng)),
                         Eigen::Vector3d(1.0, aside.x(), aside.y()).normalized());
    pair = MakePlanarPair(motion, false, 200, kNoisePx, seed);
    const Eigen::Vector3d normal = Eigen::Vector3d(0.2, -0.3, 1.0).normalized();
    while (pair.matches.size() < 240) {
      const Eigen::Vector3d ray = UniformVector({{-0.6, 0.6}, {-0.6, 0.6}}, rng).homogeneous();
      const double depth = rng.Uniform(0.5, 0.9) * 4.0 / normal.dot(ray);
      const Eigen::Vector3d X2 = motion * Eigen::Vector3d(depth * ray);
      if (X2.z() <= 0.5 || (X2.head<2>() / X2.z()).cwiseAbs().maxCoeff() > 0.75) continue;
      const auto i = static_cast<point2D_t>(pair.matches.size());
      Add(pair.camera1.ImgFromCam(ray.head<2>()), rng, &pair.keypoints1);
      Add(pair.camera2.ImgFromCam(X2.hnormalized()), rng, &pair.keypoints2);
      pair.matches.push_back({i, i});
      pair.is_inlier.push_back(true);
    }
    input = pair.Input(false);
    PreparePair(input, {}, MatchOrder::kByConsensus, &prepared);
    // It explains the plane, with the epipole a quarter turn away from the right one.
    const Eigen::Matrix3d H =
        motion.RotationMatrix() + motion.translation * normal.transpose() / 4.0;
    start = CrossMatrix(motion.translation.cross(Eigen::Vector3d::UnitZ()).normalized()) * H;
  }

  static void Add(const Eigen::Vector2d& pixel, Rng& rng, std::vector<Keypoint>* keypoints) {
    keypoints->push_back(RoundKeypoint(pixel + kNoisePx * GaussianVector<2>(rng)));
  }

  Eigen::Matrix3d Resample(const Eigen::Matrix3d& from) const {
    return ResampleFundamental(prepared, from);
  }
  // The error of the best pose that F stands for.
  double ErrorDeg(const Eigen::Matrix3d& F) const {
    double error = M_PI;
    for (const Rigid3d& pose : PosesFromEssential(NearestEssential(F))) {
      error = std::min(error, PoseError(pose, pair.cam2_from_cam1));
    }
    return RadToDeg(error);
  }
  int NumExplained(const Eigen::Matrix3d& F) const {
    return MatchErrors(prepared.points, F).CountBelow(4 * kNoisePx);
  }

  static constexpr double kNoisePx = 0.4;
  Pair pair;
  PairInput input;
  PreparedPair prepared;
  Eigen::Matrix3d start;
};

TEST(FundamentalResampling, LeavesOneThatExplainsThePlaneAlone) {
  int num_refined = 0, num_resampled = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const NearPlanar scene(seed);
    ASSERT_EQ(scene.prepared.size(), 240);
    ASSERT_GE(scene.NumExplained(scene.start), 190) << "the plane";
    ASSERT_LE(scene.NumExplained(scene.start), 225) << "not what is in front of it";
    ASSERT_GT(scene.ErrorDeg(scene.start), 30);
    // Refinement alone stays near where it begins.
    const Eigen::Matrix3d refined =
        RefineFundamentalMatrix(scene.prepared.points, scene.start, {.scale_px = 1.0}).F();
    num_refined += scene.ErrorDeg(refined) < 3;
    const Eigen::Matrix3d resampled = scene.Resample(scene.start);
    num_resampled += scene.ErrorDeg(resampled) < 3;
    EXPECT_GE(scene.NumExplained(resampled), 230) << seed;
  }
  EXPECT_LE(num_refined, 10);
  EXPECT_GE(num_resampled, 18);
}

TEST(FundamentalResampling, KeepsTheRightOne) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const NearPlanar scene(seed);
    const Eigen::Matrix3d F = scene.Resample(EssentialFromPose(scene.pair.cam2_from_cam1));
    EXPECT_LT(scene.ErrorDeg(F), 3) << seed;
  }
}

TEST(FundamentalResampling, IsAFunctionOfItsInputs) {
  const NearPlanar scene(1);
  EXPECT_EQ(scene.Resample(scene.start), scene.Resample(scene.start));
  // The sign and scale of what it begins with mean nothing.
  EXPECT_LT(HomogeneousError(scene.Resample(-7.0 * scene.start), scene.Resample(scene.start)),
            1e-6);
}

// Too few to draw a sample from: what was given comes back, refined.
TEST(FundamentalResampling, FewMatchesAreLeftAsTheyAre) {
  NearPlanar scene(2);
  scene.pair.matches.resize(6);
  scene.input = scene.pair.Input(false);
  PreparePair(scene.input, {}, MatchOrder::kByConsensus, &scene.prepared);
  ASSERT_EQ(scene.prepared.size(), 6);
  const Eigen::Matrix3d F = scene.Resample(EssentialFromPose(scene.pair.cam2_from_cam1));
  EXPECT_EQ(scene.NumExplained(F), 6);
}

}  // namespace
}  // namespace cairn::internal
