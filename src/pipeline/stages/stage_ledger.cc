#include "pipeline/stages/stage_ledger.h"

#include <map>
#include <sstream>

#include "cairn/base/error.h"
#include "cairn/base/options.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

// Throws ConfigError for the first option, by name, that differs.
void CheckOptions(const StageRecord& stored, const std::string& present) {
  const std::map<std::string, std::string> old_values = stored.OptionValues();
  const std::map<std::string, std::string> values = StageRecord{"", present}.OptionValues();
  const std::string stage = "the database's stage '" + stored.stage + "'";
  const std::string recompute = "--recompute " + stored.stage;
  for (const auto& [key, value] : values) {
    const auto old_value = old_values.find(key);
    if (old_value == old_values.end()) {
      throw ConfigError(key,
                        stage + " was made by a version without this option; use " + recompute);
    }
    if (old_value->second != value) {
      throw ConfigError(key, "is " + value + ", but " + stage + " was made with " +
                                 old_value->second + "; use the same, or " + recompute);
    }
  }
  for (const auto& [key, value] : old_values) {
    if (values.count(key) > 0 || IsRetired(key, value)) continue;
    throw ConfigError(
        key, "is " + value + " in " + stage + ", and no longer an option; use " + recompute);
  }
}

}  // namespace

std::string QualifiedOptions(std::string_view module, const std::string& dumped) {
  std::string text;
  std::istringstream lines(dumped);
  std::string line;
  while (std::getline(lines, line)) text += std::string(module) + "." + line + "\n";
  return text;
}

StageLedger::StageLedger(Database& database, const std::string& stage, const std::string& options)
    : stage_(stage), options_(options) {
  const std::optional<StageRecord> record = database.ReadStage(stage);
  if (record) CheckOptions(*record, options);
  was_begun_ = record.has_value();
  for (JobRecord& job : database.ReadJobs(stage)) {
    const uint64_t item = job.item;
    jobs_.emplace(item, std::move(job));
  }
}

const JobRecord* StageLedger::Find(uint64_t item) const {
  const auto it = jobs_.find(item);
  return it == jobs_.end() ? nullptr : &it->second;
}

bool StageLedger::IsDone(uint64_t item, uint64_t input_hash, const std::string& what) const {
  const JobRecord* job = Find(item);
  if (job == nullptr) return false;
  if (job->input_hash != input_hash) ThrowChanged(what);
  return true;
}

void StageLedger::ThrowChanged(const std::string& what) const {
  throw ConfigError("database", what + " changed since the stage '" + stage_ +
                                    "' was computed; use --recompute " + stage_);
}

void StageLedger::Begin(Database& database) {
  database.WriteStage({stage_, options_, false});
  was_begun_ = true;
}

void StageLedger::Complete(Database& database) {
  if (was_begun_) database.WriteStage({stage_, options_, true});
}

StageReport EndStage(Stage& stage, const RunContext& run, StageLedger& ledger, Database& database) {
  if (run.monitor.StopRequested()) {
    stage.MarkStopped();
  } else {
    ledger.Complete(database);
  }
  return EndStage(stage, database);
}

StageReport EndStage(Stage& stage, Database& database) {
  StageReport report = stage.Finish();
  database.AddStageTime(report.name, report.seconds);
  return report;
}

}  // namespace cairn
