#include "report/stage.h"

#include "support/test.h"
#include "support/test_monitor.h"

namespace cairn {
namespace {

TEST(Stage, MessagesAreShownAndKept) {
  TestMonitor monitor;
  Stage stage(monitor, "reading");
  stage.Note("a note");
  stage.Add("images", 3);
  stage.Record("a detail");
  stage.Warn("a warning");
  const StageReport report = stage.Finish();
  EXPECT_EQ(report.name, "reading");
  EXPECT_EQ(report.status, StageStatus::kWarning);
  EXPECT_THAT(report.messages, ElementsAre("a note", "a detail", "a warning"));
  EXPECT_THAT(report.values, ElementsAre(std::pair<std::string, double>("images", 3)));
  EXPECT_THAT(monitor.notes(), ElementsAre("a note"));
  EXPECT_THAT(monitor.warnings(), ElementsAre("a warning"));
  EXPECT_THAT(monitor.stages(), IsEmpty());
}

TEST(Stage, RecordedWarningsAreForTheReportAlone) {
  TestMonitor monitor;
  Stage stage(monitor, "judgement");
  stage.RecordWarning("a doubt");
  const StageReport report = stage.Finish();
  EXPECT_EQ(report.status, StageStatus::kWarning);
  EXPECT_THAT(report.messages, ElementsAre("a doubt"));
  EXPECT_THAT(monitor.warnings(), IsEmpty());
}

// A folder may have a thousand cameras.
TEST(Stage, OfManyWarningsTheFirstTenAreShownAndAllKept) {
  for (const int num : {10, 13}) {
    TestMonitor monitor;
    Stage stage(monitor, "reading");
    std::vector<std::string> warnings;
    for (int i = 0; i < num; ++i) warnings.push_back("camera " + std::to_string(i));
    stage.WarnEach(warnings);
    stage.NoteEach({"a note"});
    const StageReport report = stage.Finish();
    EXPECT_EQ(report.status, StageStatus::kWarning);
    EXPECT_EQ(report.messages.size(), num + 1u);
    EXPECT_EQ(report.messages.back(), "a note");
    ASSERT_EQ(monitor.warnings().size(), num == 10 ? 10u : 11u);
    EXPECT_EQ(monitor.warnings()[9], "camera 9");
    if (num > 10) {
      EXPECT_EQ(monitor.warnings()[10], "... 3 more such lines are in the report");
    }
  }
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
