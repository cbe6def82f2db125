#include "cairn/resection/resection.h"

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

struct ResectionProblem {
  Camera camera;
  Rigid3d pose;
  std::vector<Eigen::Vector3d> xyz;
  std::vector<Eigen::Vector2d> pixels;
};

ResectionProblem MakeProblem(int n, double outlier_share, double noise_px, uint64_t seed) {
  Rng rng(seed, "resection test");
  ResectionProblem problem;
  problem.camera =
      Camera::FromFocal(1, CameraModel::kSimpleRadial, rng.Uniform(700, 1200), 1200, 800);
  problem.camera.params[3] = -0.03;
  const Eigen::Vector3d translation = GaussianVector<3>(rng);
  problem.pose = Rigid3d(ExpSO3(GaussianVector<3>(rng)), translation);
  for (int i = 0; i < n; ++i) {
    Eigen::Vector2d pixel = UniformVector({{0, 1200}, {0, 800}}, rng);
    const Eigen::Vector3d x =
        rng.Uniform(2, 8) * problem.camera.CamFromImg(pixel).value().homogeneous();
    problem.xyz.push_back(Inverse(problem.pose) * x);
    pixel += noise_px * GaussianVector<2>(rng);
    if (rng.Uniform() < outlier_share) pixel = {rng.Uniform(0, 1200), rng.Uniform(0, 800)};
    problem.pixels.push_back(pixel);
  }
  return problem;
}

ResectionReport Resect(const ResectionProblem& problem, const ResectionOptions& options,
                       bool focal = false) {
  return EstimateAbsolutePose(problem.camera, {problem.pixels, problem.xyz}, focal, options,
                              Rng(5, "resection", 9));
}

TEST(EstimateAbsolutePose, IsExactWithoutNoise) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    const ResectionProblem problem = MakeProblem(30, 0, 0, seed);
    const ResectionReport report = Resect(problem, {});
    ASSERT_EQ(report.status, ResectionStatus::kSuccess);
    EXPECT_EQ(report.inliers.size(), 30u);
    EXPECT_LT(AngleBetween(report.cam_from_world.rotation, problem.pose.rotation), 1e-7);
    EXPECT_LT((report.cam_from_world.translation - problem.pose.translation).norm(), 1e-6);
    EXPECT_EQ(report.camera.params, problem.camera.params);
  }
}

// Points beside and behind the camera count like any others.
TEST(EstimateAbsolutePose, IsExactForLensesThatSeeAllAround) {
  for (uint64_t seed = 0; seed < 30; ++seed) {
    Rng rng(seed, "wide resection test");
    ResectionProblem problem;
    problem.camera = Camera::FromFocal(1, CameraModel::kOpenCVFisheye, 350, 1500, 1500);
    problem.camera.params[4] = 0.02;
    const Eigen::Vector3d translation = GaussianVector<3>(rng);
    const Eigen::Vector2d turn = GaussianVector<2>(rng);
    problem.pose = Rigid3d(ExpSO3({turn.x(), turn.y(), 0.3}), translation);
    int num_behind = 0;
    while (problem.pixels.size() < 100) {
      Eigen::Vector2d pixel = UniformVector({{0, 1500}, {0, 1500}}, rng);
      const auto ray = problem.camera.RayFromImg(pixel);
      if (!ray) continue;
      num_behind += ray->z() < 0;
      problem.xyz.push_back(Inverse(problem.pose) * Eigen::Vector3d(rng.Uniform(2, 8) * *ray));
      if (problem.pixels.size() < 30) pixel = {rng.Uniform(0, 1500), rng.Uniform(0, 1500)};
      problem.pixels.push_back(pixel);
    }
    ASSERT_GT(num_behind, 20);
    const ResectionReport report = Resect(problem, {});
    ASSERT_EQ(report.status, ResectionStatus::kSuccess);
    EXPECT_GE(report.inliers.size(), 70u);
    EXPECT_LT(AngleBetween(report.cam_from_world.rotation, problem.pose.rotation), 1e-4);
    EXPECT_LT((report.cam_from_world.translation - problem.pose.translation).norm(), 1e-3);
  }
}

TEST(EstimateAbsolutePose, WithstandsOutliers) {
  int num_good = 0;
  ResectionOptions options;
  options.min_inlier_ratio = 0.1;
  for (uint64_t seed = 0; seed < 30; ++seed) {
    const ResectionProblem problem = MakeProblem(200, 0.7, 0.5, seed);
    const ResectionReport report = Resect(problem, options);
    if (report.status != ResectionStatus::kSuccess) continue;
    num_good += AngleBetween(report.cam_from_world.rotation, problem.pose.rotation) < 0.01 &&
                (report.cam_from_world.translation - problem.pose.translation).norm() < 0.05;
  }
  EXPECT_GE(num_good, 29);
}

TEST(EstimateAbsolutePose, FindsAFocalLengthThatWasOnlyGuessed) {
  int num_good = 0;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    ResectionProblem problem = MakeProblem(150, 0.3, 0.3, seed);
    const double truth = problem.camera.MeanFocal();
    problem.camera.SetMeanFocal(truth * (seed % 2 ? 1.6 : 0.6));
    const ResectionReport report = Resect(problem, {}, true);
    num_good += report.status == ResectionStatus::kSuccess &&
                std::abs(report.camera.MeanFocal() / truth - 1) < 0.02;
    ResectionOptions no_guesses;
    no_guesses.num_focal_guesses = 0;
    const ResectionReport guess_alone = Resect(problem, no_guesses, true);
    EXPECT_LT(guess_alone.num_iterations, report.num_iterations);
    EXPECT_LT(guess_alone.inliers.size(), report.inliers.size() + 5);
  }
  EXPECT_GE(num_good, 10);
}

TEST(EstimateAbsolutePose, SameSeedSameResult) {
  const ResectionProblem problem = MakeProblem(100, 0.5, 1, 3);
  const ResectionReport a = Resect(problem, {});
  const ResectionReport b = Resect(problem, {});
  EXPECT_EQ(a.cam_from_world.translation, b.cam_from_world.translation);
  EXPECT_EQ(a.inliers, b.inliers);
  EXPECT_EQ(a.num_iterations, b.num_iterations);
}

TEST(EstimateAbsolutePose, SaysWhyThereIsNoPose) {
  EXPECT_EQ(Resect(MakeProblem(10, 0, 0, 1), {}).status, ResectionStatus::kTooFewPoints);
  EXPECT_EQ(Resect(MakeProblem(0, 0, 0, 1), {}).status, ResectionStatus::kTooFewPoints);
  EXPECT_EQ(Resect(MakeProblem(100, 1.0, 0, 1), {}).status, ResectionStatus::kTooFewInliers);
  ResectionProblem point = MakeProblem(50, 0, 0, 1);
  for (Eigen::Vector3d& xyz : point.xyz) xyz.setZero();
  EXPECT_EQ(Resect(point, {}).status, ResectionStatus::kNoModel);
}

TEST(EstimateAbsolutePose, OptionsDecide) {
  const ResectionProblem problem = MakeProblem(100, 0.5, 1.0, 4);
  ResectionOptions options;
  const size_t num_inliers = Resect(problem, options).inliers.size();
  options.max_error_px = 1;
  EXPECT_LT(Resect(problem, options).inliers.size(), num_inliers);
  options = {};
  options.min_num_inliers = 90;
  EXPECT_EQ(Resect(problem, options).status, ResectionStatus::kTooFewInliers);
  options = {};
  options.min_inlier_ratio = 0.9;
  EXPECT_EQ(Resect(problem, options).status, ResectionStatus::kTooFewInliers);
  options = {};
  options.max_iterations = 1;
  EXPECT_EQ(Resect(problem, options).num_iterations, 1);
  options = {};
  options.confidence = 0.1;
  const int few = Resect(MakeProblem(100, 0.7, 1.0, 4), options).num_iterations;
  options.confidence = 0.999999;
  EXPECT_GT(Resect(MakeProblem(100, 0.7, 1.0, 4), options).num_iterations, few);
}

TEST(EstimateAbsolutePose, RefusesMeaninglessOptions) {
  ResectionOptions options;
  options.max_error_px = -1;
  EXPECT_THROW(EstimateAbsolutePose(Camera(), {}, false, options, Rng(0)), ConfigError);
}

}  // namespace
}  // namespace cairn
