#include "report/stage.h"

#include <gmock/gmock.h>

#include "support/test_monitor.h"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(Stage, WarningsAreShownAndKept) {
  TestMonitor monitor;
  Stage stage(monitor, "reading");
  stage.Note("a note");
  stage.Add("images", 3);
  stage.Keep("shown before");
  stage.Warn("a warning");
  const StageReport report = stage.Finish();
  EXPECT_EQ(report.name, "reading");
  EXPECT_EQ(report.status, StageStatus::kWarning);
  EXPECT_THAT(report.messages, ElementsAre("a note", "shown before", "a warning"));
  EXPECT_THAT(report.values, ElementsAre(std::pair<std::string, double>("images", 3)));
  EXPECT_THAT(monitor.warnings(), ElementsAre("a warning"));
  EXPECT_THAT(monitor.stages(), IsEmpty());
}

TEST(Stage, WhatTheUserStoppedIsNoWarning) {
  Stage stage(NullMonitor(), "reading");
  stage.Warn("a warning");
  stage.MarkStopped();
  EXPECT_TRUE(stage.Finish().WasStopped());
  Stage skipped(NullMonitor(), "depth");
  skipped.MarkSkipped();
  EXPECT_EQ(skipped.Finish().status, StageStatus::kSkipped);
}

TEST(RunStage, EndsInTheReportOfTheRun) {
  TestMonitor monitor;
  RunReport run;
  { RunStage(run, monitor, "first", 7); }
  {
    RunStage stage(run, monitor, "second");
    stage.Fail("nothing there", "try more");
  }
  ASSERT_EQ(run.stages.size(), 2u);
  EXPECT_EQ(run.stages[0].status, StageStatus::kOk);
  EXPECT_EQ(run.stages[1].status, StageStatus::kFailed);
  EXPECT_EQ(run.failure, "second: nothing there; try more");
  EXPECT_THAT(run.stages[1].messages, ElementsAre(run.failure));
  EXPECT_THAT(monitor.stages(), ElementsAre("first", "second"));
  EXPECT_THAT(monitor.totals(), ElementsAre(7, 0));
}

}  // namespace
}  // namespace cairn
