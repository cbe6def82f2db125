#include "cairn/report/run_report.h"

#include "support/test.h"

namespace cairn {
namespace {

RunReport Example() {
  RunReport report;
  report.program = "program";
  report.seed = 7;
  report.num_threads = 2;
  StageReport stage;
  stage.name = "first";
  stage.seconds = 0.25;
  stage.Add("images", 3).Add("error_px", 0.5);
  report.stages.push_back(stage);
  stage = {};
  stage.name = "second";
  stage.status = StageStatus::kFailed;
  stage.messages = {"a \"quoted\" reason"};
  report.stages.push_back(stage);
  return report;
}

TEST(RunReport, JsonHoldsEverythingInOrder) {
  RunReport report = Example();
  const std::string json = ToJson(report);
  EXPECT_THAT(json, HasSubstr("\"program\": \"program\""));
  EXPECT_THAT(json, HasSubstr("\"seed\": 7,"));
  EXPECT_THAT(json, HasSubstr("\"num_threads\": 2,"));
  EXPECT_THAT(json, HasSubstr("\"seconds\": 0.25"));
  EXPECT_THAT(json, HasSubstr("\"images\": 3,"));
  EXPECT_THAT(json, HasSubstr("\"error_px\": 0.5"));
  EXPECT_THAT(json, HasSubstr("\"status\": \"failed\""));
  EXPECT_THAT(json, HasSubstr("a \\\"quoted\\\" reason"));
  EXPECT_THAT(json, HasSubstr("\"succeeded\": true"));
  EXPECT_LT(json.find("first"), json.find("second"));
  EXPECT_EQ(json.back(), '\n');
  report.failure = "second: nothing there; try more";
  EXPECT_THAT(ToJson(report), HasSubstr("\"failure\": \"second: nothing there; try more\""));
  EXPECT_THAT(ToJson(report), HasSubstr("\"succeeded\": false"));
}

TEST(RunReport, NamesThatAreNoUnicodeDoNotEndTheRun) {
  RunReport report = Example();
  report.stages[0].messages = {"photo\xff.jpg: skipped"};
  EXPECT_THAT(ToJson(report), HasSubstr(".jpg: skipped"));
}

}  // namespace
}  // namespace cairn
