#include "cairn/report/stage.h"

#include <algorithm>

#include "base/memory.h"

namespace cairn {

Stage::Stage(RunReport& report, ProgressMonitor& monitor, const std::string& name, int64_t total)
    : run_(report), monitor_(monitor) {
  report_.name = name;
  monitor_.BeginStage(name, total);
}

Stage::~Stage() {
  report_.seconds = timer_.Seconds();
  report_.memory_gib = BytesToGib(std::max<int64_t>(0, ReadMemoryUse().resident));
  monitor_.EndStage();
  run_.stages.push_back(std::move(report_));
}

void Stage::Note(const std::string& message) {
  report_.messages.push_back(message);
  monitor_.Info(message);
}

void Stage::Warn(const std::string& message) {
  report_.messages.push_back(message);
  if (report_.status == StageStatus::kOk) report_.status = StageStatus::kWarning;
  monitor_.Warning(message);
}

void Stage::Fail(const std::string& what_was_there, const std::string& what_to_try) {
  report_.status = StageStatus::kFailed;
  run_.failure = report_.name + ": " + what_was_there + "; " + what_to_try;
  report_.messages.push_back(run_.failure);
}

}  // namespace cairn
