#include "relative_pose_experiments/stability.h"

#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "relative_pose_experiments/noise.h"
#include "support/test.h"

namespace cairn::experiments {
namespace {

TEST(Stability, AllSolversHoldTheBounds) {
  const std::vector<FigureCheck> checks = RunStability(MakeInstances(0, 200, 1), 1).checks;
  ASSERT_EQ(checks.size(), 4 * kAllSolvers.size());
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

void ExpectEqualTables(const Results& a, const Results& b) {
  ASSERT_EQ(a.tables.size(), 2u);
  for (const auto& [name, table] : a.tables) {
    EXPECT_EQ(table.ToCsv(), b.tables.at(name).ToCsv()) << name;
  }
}

TEST(Stability, TablesDoNotDependOnTheNumberOfThreads) {
  const auto instances = MakeInstances(5, 150, 1);
  ExpectEqualTables(RunStability(instances, 1), RunStability(instances, 4));
}

TEST(Noise, TablesDoNotDependOnTheNumberOfThreads) {
  const auto instances = MakeInstances(6, 10, 1);
  ExpectEqualTables(RunNoise(instances, 6, 1, NullMonitor()),
                    RunNoise(instances, 6, 4, NullMonitor()));
}

}  // namespace
}  // namespace cairn::experiments
