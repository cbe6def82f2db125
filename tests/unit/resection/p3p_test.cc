#include "resection/p3p.h"

#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

Eigen::Vector3d RandomVector(Rng& rng) { return {rng.Gaussian(), rng.Gaussian(), rng.Gaussian()}; }

Rigid3d RandomPose(Rng& rng) {
  const Eigen::Vector3d translation = RandomVector(rng);
  return Rigid3d(ExpSO3(1.5 * RandomVector(rng)), translation);
}

std::array<P3pSample, 3> RandomSamples(Rng& rng, const Rigid3d& pose) {
  std::array<P3pSample, 3> samples;
  for (P3pSample& sample : samples) {
    const Eigen::Vector3d ray =
        Eigen::Vector3d(UniformVector({{-1, 1}, {-1, 1}}, rng).homogeneous()).normalized();
    sample.ray = ray;
    sample.xyz = Inverse(pose) * Eigen::Vector3d(rng.Uniform(1, 10) * ray);
  }
  return samples;
}

TEST(P3p, FindsTheTruePose) {
  Rng rng(1);
  const int num_trials = 10000;
  int num_found = 0;
  for (int trial = 0; trial < num_trials; ++trial) {
    const Rigid3d pose = RandomPose(rng);
    const auto samples = RandomSamples(rng, pose);
    Rigid3d models[4];
    const int num = P3pSolver::Solve(samples.data(), models);
    double best = 1e9;
    for (int i = 0; i < num; ++i) {
      best = std::min(best, AngleBetween(models[i].rotation, pose.rotation) +
                                (models[i].translation - pose.translation).norm());
    }
    num_found += best < 1e-6;
  }
  EXPECT_GE(num_found, 0.999 * num_trials);
}

TEST(P3p, EverySolutionReprojectsExactlyAndInFront) {
  Rng rng(2);
  int64_t num_solutions = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const auto samples = RandomSamples(rng, RandomPose(rng));
    Rigid3d models[4];
    const int num = P3pSolver::Solve(samples.data(), models);
    for (int i = 0; i < num; ++i) {
      for (const P3pSample& sample : samples) {
        const Eigen::Vector3d x = models[i] * sample.xyz;
        ASSERT_GT(x.dot(sample.ray), 0);
        ASSERT_LT(x.normalized().cross(sample.ray).norm(), 1e-5);
      }
      ++num_solutions;
    }
  }
  EXPECT_GT(num_solutions, 2000);  // more than one on average
}

TEST(P3p, DoesNotDependOnTheWorldsUnit) {
  Rng rng(3);
  const Rigid3d pose = RandomPose(rng);
  auto samples = RandomSamples(rng, pose);
  Rigid3d models[4];
  Rigid3d scaled[4];
  const int num = P3pSolver::Solve(samples.data(), models);
  for (P3pSample& sample : samples) sample.xyz *= 1e4;
  ASSERT_EQ(P3pSolver::Solve(samples.data(), scaled), num);
  for (int i = 0; i < num; ++i) {
    EXPECT_LT(AngleBetween(models[i].rotation, scaled[i].rotation), 1e-7);
    EXPECT_LT((1e4 * models[i].translation - scaled[i].translation).norm(), 1e-2);
  }
}

TEST(P3p, CollinearOrEqualPointsGiveNothing) {
  Rng rng(4);
  auto samples = RandomSamples(rng, RandomPose(rng));
  Rigid3d models[4];
  samples[2].xyz = 0.3 * samples[0].xyz + 0.7 * samples[1].xyz;
  EXPECT_EQ(P3pSolver::Solve(samples.data(), models), 0);
  samples[2].xyz = samples[1].xyz = samples[0].xyz;
  EXPECT_EQ(P3pSolver::Solve(samples.data(), models), 0);
}

}  // namespace
}  // namespace cairn
