#include "relative_pose_experiments/stability.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "relative_pose_experiments/noise.h"

namespace cairn::experiments {
namespace {

TEST(Stability, AllSolversHoldTheBounds) {
  const auto figures = RunStability(MakeInstances(0, 200, 1), 1);
  ASSERT_EQ(figures.size(), kAllSolvers.size());
  const std::vector<FigureCheck> checks = Checks(figures);
  ASSERT_GE(checks.size(), 4u);
  for (const FigureCheck& check : checks) {
    EXPECT_TRUE(check.Holds()) << check.name << " = " << check.value;
  }
}

TEST(Stability, MeasuresTheErrorsOfAnyEstimator) {
  const auto instances = MakeInstances(0, 50, 1);
  const Eigen::Quaterniond turn = ExpSO3(Eigen::Vector3d(0, 0, DegToRad(3.0)));
  int64_t index = 0;
  const auto figures = MeasureStability(
      "turned by three degrees",
      [&](const Instance& instance) -> std::optional<Rigid3d> {
        if (index++ == 0) return std::nullopt;
        Rigid3d pose = instance.cam2_from_cam1;
        pose.rotation = turn * pose.rotation;
        pose.translation *= 7.0;  // only the direction counts
        return pose;
      },
      instances, 1);
  EXPECT_EQ(figures.num_without_model, 1);
  ASSERT_EQ(figures.rotation_deg.size(), 49u);
  for (const double error : figures.rotation_deg) EXPECT_NEAR(error, 3.0, 1e-9);
  for (const double error : figures.translation_deg) EXPECT_LT(error, 1e-9);
  for (const double error : figures.sampson_px) EXPECT_GT(error, 0.01);
}

TEST(Stability, TablesDoNotDependOnTheNumberOfThreads) {
  const auto instances = MakeInstances(5, 150, 1);
  const auto one = RunStability(instances, 1), many = RunStability(instances, 4);
  EXPECT_EQ(ToTable(one).ToCsv(), ToTable(many).ToCsv());
  EXPECT_EQ(HistogramTable(one).ToCsv(), HistogramTable(many).ToCsv());
}

TEST(Noise, TablesDoNotDependOnTheNumberOfThreads) {
  const auto instances = MakeInstances(6, 10, 1);
  const auto one = RunNoise(instances, 6, 1, NullMonitor());
  const auto many = RunNoise(instances, 6, 4, NullMonitor());
  EXPECT_EQ(CurveTable(one).ToCsv(), CurveTable(many).ToCsv());
  EXPECT_EQ(HeatMapTable(one).ToCsv(), HeatMapTable(many).ToCsv());
}

TEST(Noise, WithoutNoiseEverythingIsExact) {
  const auto report = RunNoise(MakeInstances(7, 20, 1), 7, 1, NullMonitor());
  ASSERT_EQ(report.curves.size(), 6u);
  for (const NoiseCurve& curve : report.curves) {
    if (curve.setup != "alone") continue;
    for (int s = 0; s < kNumSolvers; ++s) {
      EXPECT_LT(curve.figures[s].rotation_median_deg, 1e-6);
      EXPECT_LT(curve.figures[s].translation_median_deg, 1e-6);
    }
  }
}

}  // namespace
}  // namespace cairn::experiments
