#include "report/stage.h"

#include <algorithm>
#include <iterator>

#include "base/memory.h"

namespace cairn {
namespace {

constexpr size_t kMaxShown = 10;

std::vector<std::string> FirstLines(std::vector<std::string> lines) {
  if (lines.size() <= kMaxShown) return lines;
  const size_t num_more = lines.size() - kMaxShown;
  lines.resize(kMaxShown);
  lines.push_back("... " + std::to_string(num_more) + " more such lines are in the report");
  return lines;
}

}  // namespace

Stage::Stage(ProgressMonitor& monitor, const std::string& name) : monitor_(monitor) {
  report_.name = name;
}

void Stage::Note(const std::string& message) {
  Record(message);
  monitor_.Info(message);
}

void Stage::Warn(const std::string& message) {
  monitor_.Warning(message);
  RecordWarning(message);
}

void Stage::Warn(const ResultWarning& warning) {
  monitor_.Warning(WarningText(warning));
  RecordWarning(warning);
}

void Stage::RecordWarning(const ResultWarning& warning) {
  RecordWarning(WarningText(warning));
  report_.warnings.push_back(warning);
}

void Stage::NoteEach(const std::vector<std::string>& messages) {
  for (const std::string& line : FirstLines(messages)) monitor_.Info(line);
  report_.messages.insert(report_.messages.end(), messages.begin(), messages.end());
}

void Stage::WarnEach(const std::vector<std::string>& messages) {
  for (const std::string& line : FirstLines(messages)) monitor_.Warning(line);
  for (const std::string& message : messages) RecordWarning(message);
}

void Stage::RecordWarning(const std::string& message) {
  Record(message);
  if (report_.status == StageStatus::kOk) report_.status = StageStatus::kWarning;
}

StageReport Stage::Finish() {
  report_.seconds = timer_.Seconds();
  report_.memory_gib = BytesToGib(std::max<int64_t>(0, ReadMemoryUse().resident));
  return std::move(report_);
}

RunStage::RunStage(RunReport& run, ProgressMonitor& monitor, const std::string& name, int64_t total)
    : Stage(monitor, name), run_(run) {
  monitor_.BeginStage(name, total);
}

RunStage::~RunStage() {
  monitor_.EndStage();
  std::ranges::move(report_.warnings, std::back_inserter(run_.warnings));
  report_.warnings.clear();
  run_.stages.push_back(Finish());
}

void RunStage::Fail(const std::string& what_was_there, const std::string& what_to_try) {
  report_.status = StageStatus::kFailed;
  run_.failure = report_.name + ": " + what_was_there + "; " + what_to_try;
  report_.messages.push_back(run_.failure);
}

}  // namespace cairn
