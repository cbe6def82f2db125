#include <algorithm>
#include <cmath>
#include <vector>

#include "cairn/geometry/epipolar.h"
#include "cairn/solvers/five_point.h"
#include "cairn/solvers/seven_point.h"
#include "cairn/solvers/two_affine.h"
#include "support/instruction_sets.h"
#include "support/random_two_view.h"
#include "support/test.h"

namespace cairn {
namespace {

// The smallest error over a solver's models, and whether all of them fulfil the constraints of an
// essential matrix and the equations of the sample.
template <class Solver>
double BestError(const typename Solver::Sample* samples, const Eigen::Matrix3d& truth) {
  Eigen::Matrix3d models[Solver::kMaxSolutions];
  const int count = Solver::Solve(samples, models);
  EXPECT_LE(count, Solver::kMaxSolutions);
  double best = 1e300;
  for (int i = 0; i < count; ++i) best = std::min(best, HomogeneousError(models[i], truth));
  return best;
}

TEST(FivePoint, FindsTheTruthInNearlyAllSamples) {
  Rng rng(1);
  int num_found = 0;
  constexpr int kNumTrials = 10000;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    const TwoViewScene scene = RandomScene(rng, 5);
    PointCorrespondence samples[5];
    for (int i = 0; i < 5; ++i) samples[i] = scene.patches[i].points();
    num_found += BestError<FivePoint>(samples, EssentialFromPose(scene.cam2_from_cam1)) < 1e-6;
  }
  EXPECT_GE(num_found, 0.999 * kNumTrials);
  RecordProperty("found", num_found);
}

TEST(FivePoint, EveryModelFitsTheSampleAndIsEssential) {
  Rng rng(2);
  int num_models = 0;
  for (int trial = 0; trial < 200; ++trial) {
    PointCorrespondence samples[5];  // no scene at all: models need not be the truth of anything
    for (auto& s : samples) {
      s.x1 = {rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5)};
      s.x2 = {rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5)};
    }
    Eigen::Matrix3d models[FivePoint::kMaxSolutions];
    const int count = FivePoint::Solve(samples, models);
    for (int i = 0; i < count; ++i) {
      const Eigen::Matrix3d& E = models[i];
      EXPECT_NEAR(E.squaredNorm(), 2.0, 1e-12);
      EXPECT_LT((2.0 * E * E.transpose() * E - (E * E.transpose()).trace() * E).norm(), 1e-6);
      for (const auto& s : samples) {
        EXPECT_NEAR(s.x2.homogeneous().dot(E * s.x1.homogeneous()), 0.0, 1e-12);
      }
    }
    num_models += count;
  }
  EXPECT_GT(num_models, 400);
}

TEST(FivePoint, CoincidentPointsGiveNoCrash) {
  PointCorrespondence samples[5];
  Eigen::Matrix3d models[FivePoint::kMaxSolutions];
  const int count = FivePoint::Solve(samples, models);
  for (int i = 0; i < count; ++i) EXPECT_TRUE(models[i].allFinite());
}

// The same bits with every instruction set of this machine.
TEST(FivePoint, DoesNotDependOnTheInstructionSet) {
  auto compute = [] {
    Rng rng(8);
    std::vector<Eigen::Matrix3d> all;
    for (int trial = 0; trial < 200; ++trial) {
      const TwoViewScene scene = RandomScene(rng, 5);
      PointCorrespondence points[5];
      for (int i = 0; i < 5; ++i) points[i] = scene.patches[i].points();
      const AffineCorrespondence frames[2] = {scene.patches[0].affine, scene.patches[1].affine};
      Eigen::Matrix3d models[FivePoint::kMaxSolutions];
      all.insert(all.end(), models, models + FivePoint::Solve(points, models));
      all.insert(all.end(), models, models + TwoAffineFivePoint::Solve(frames, models));
    }
    return all;
  };
  const std::vector<Eigen::Matrix3d> expected = compute();
  EXPECT_GT(expected.size(), 1000u);
  ForEachInstructionSet([&] { EXPECT_EQ(compute(), expected); });
}

TEST(SevenPoint, FindsTheTruth) {
  Rng rng(3);
  int num_found = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const TwoViewScene scene = RandomScene(rng, 7);
    PointCorrespondence samples[7];
    for (int i = 0; i < 7; ++i) samples[i] = scene.patches[i].points();
    num_found += BestError<SevenPoint>(samples, EssentialFromPose(scene.cam2_from_cam1)) < 1e-6;
  }
  EXPECT_GE(num_found, 999);
}

TEST(TwoAffine, BothFormsFindTheTruth) {
  Rng rng(4);
  int num_linear = 0, num_five_point = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const TwoViewScene scene = RandomScene(rng, 2);
    const AffineCorrespondence samples[2] = {scene.patches[0].affine, scene.patches[1].affine};
    const Eigen::Matrix3d truth = EssentialFromPose(scene.cam2_from_cam1);
    num_linear += BestError<TwoAffine>(samples, truth) < 1e-6;
    num_five_point += BestError<TwoAffineFivePoint>(samples, truth) < 1e-6;
  }
  EXPECT_GE(num_linear, 999);
  EXPECT_GE(num_five_point, 999);
}

TEST(TwoAffine, DoesNotDependOnTheSizeOfTheFrames) {
  Rng rng(5);
  const TwoViewScene scene = RandomScene(rng, 2);
  AffineCorrespondence samples[2] = {scene.patches[0].affine, scene.patches[1].affine};
  for (auto& s : samples) {
    s.frame1.shape *= 1e-3;
    s.frame2.shape *= 1e-3;
  }
  EXPECT_LT(BestError<TwoAffine>(samples, EssentialFromPose(scene.cam2_from_cam1)), 1e-6);
  samples[0].frame1.shape.setZero();
  samples[0].frame2.shape.setZero();
  Eigen::Matrix3d models[TwoAffineFivePoint::kMaxSolutions];
  EXPECT_EQ(TwoAffine::Solve(samples, models), 0);
  EXPECT_EQ(TwoAffineFivePoint::Solve(samples, models), 0);
}

}  // namespace
}  // namespace cairn
