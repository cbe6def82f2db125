#include "resection/pose_refinement.h"

#include <numeric>

#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

struct Problem {
  Camera camera;
  Rigid3d pose;
  std::vector<Eigen::Vector3d> xyz;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<int> all;
};

Problem MakeProblem(CameraModel model, uint64_t seed) {
  Rng rng(seed);
  Problem problem;
  const bool is_planar = CameraModelIsPlanar(model);
  problem.camera = Camera::FromFocal(1, model, is_planar ? 900 : 350, 1200, 800);
  for (const int k : problem.camera.DistortionIndices()) {
    problem.camera.params[k] += rng.Uniform(-0.01, 0.01);
  }
  problem.pose = Rigid3d(ExpSO3(Eigen::Vector3d(0.3, -2, 0.5)), Eigen::Vector3d(0.5, 0.2, 1));
  while (problem.pixels.size() < 40) {
    const Eigen::Vector2d pixel = UniformVector({{0, 1200}, {0, 800}}, rng);
    const auto ray = problem.camera.RayFromImg(pixel);
    if (!ray) continue;  // beyond the fold of a fisheye
    problem.xyz.push_back(Inverse(problem.pose) * Eigen::Vector3d(rng.Uniform(2, 8) * *ray));
    problem.pixels.push_back(pixel);
  }
  problem.all.resize(40);
  std::iota(problem.all.begin(), problem.all.end(), 0);
  return problem;
}

TEST(RefinePose, ConvergesToTheExactPoseAndFocalLength) {
  for (int model_id = 0; model_id < kNumCameraModels; ++model_id) {
    const CameraModel model = *CameraModelFromId(model_id);
    for (const bool refine_focal : {false, true}) {
      if (refine_focal && model == CameraModel::kEquirectangular) continue;
      const Problem problem = MakeProblem(model, 1);
      Camera camera = problem.camera;
      if (refine_focal) camera.SetMeanFocal(1.15 * camera.MeanFocal());
      Rigid3d pose = problem.pose;
      pose.rotation = ExpSO3(Eigen::Vector3d(0.02, -0.03, 0.01)) * pose.rotation;
      pose.translation += Eigen::Vector3d(0.1, -0.05, 0.1);
      const AbsolutePoseRefinementOptions options{refine_focal, 50, 200};
      EXPECT_GT(RefinePose({problem.pixels, problem.xyz}, problem.all, options, camera, pose), 2);
      EXPECT_LT(AngleBetween(pose.rotation, problem.pose.rotation), 1e-7);
      EXPECT_LT((pose.translation - problem.pose.translation).norm(), 1e-6);
      EXPECT_NEAR(camera.MeanFocal(), problem.camera.MeanFocal(), 1e-3);
    }
  }
}

// As those of maps are.
TEST(RefinePose, WorldCoordinatesMayBeLarge) {
  Problem problem = MakeProblem(CameraModel::kPinhole, 1);
  const Eigen::Vector3d origin(5e5, 5e6, 300);
  for (Eigen::Vector3d& X : problem.xyz) X += origin;
  const Eigen::Vector3d center = problem.pose.Center() + origin;
  const Eigen::Quaterniond rotation =
      ExpSO3(Eigen::Vector3d(0.02, -0.03, 0.01)) * problem.pose.rotation;
  Rigid3d pose(rotation, rotation * -(center + Eigen::Vector3d(0.1, -0.05, 0.1)));
  RefinePose({problem.pixels, problem.xyz}, problem.all, {.loss_scale_px = 200}, problem.camera,
             pose);
  EXPECT_LT(AngleBetween(pose.rotation, problem.pose.rotation), 1e-6);
  EXPECT_LT((pose.Center() - center).norm(), 1e-5);
}

TEST(RefinePose, LeavesAPoseWithPointsBehindAlone) {
  const Problem problem = MakeProblem(CameraModel::kPinhole, 2);
  Camera camera = problem.camera;
  Rigid3d pose = problem.pose;
  pose.translation.z() -= 20;
  const Rigid3d before = pose;
  EXPECT_EQ(
      RefinePose({problem.pixels, problem.xyz}, problem.all, {.loss_scale_px = 5}, camera, pose),
      0);
  EXPECT_EQ(pose.translation, before.translation);
}

}  // namespace
}  // namespace cairn
