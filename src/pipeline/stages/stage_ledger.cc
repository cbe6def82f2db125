#include "pipeline/stages/stage_ledger.h"

#include <map>

#include "cairn/base/error.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

// What helps where a stage was made from something else. A data set is imported once.
std::string Remedy(const std::string& stage) {
  return stage == kStageDataset ? "a new database" : "--recompute " + stage;
}

}  // namespace

void CheckStageOptions(const Database& database, const std::string& name,
                       const std::string& options) {
  const std::optional<StageRecord> record = database.ReadStage(name);
  if (!record) return;
  const std::map<std::string, std::string> old_values = record->OptionValues();
  const std::map<std::string, std::string> values = StageRecord{"", options}.OptionValues();
  const std::string stage = "the database's stage '" + name + "'";
  const std::string remedy = Remedy(name);
  for (const auto& [key, value] : values) {
    const auto old_value = old_values.find(key);
    if (old_value == old_values.end()) {
      throw ConfigError(key, stage + " was made by a version without this option; use " + remedy);
    }
    if (old_value->second != value) {
      throw ConfigError(key, "is " + value + ", but " + stage + " was made with " +
                                 old_value->second + "; use the same, or " + remedy);
    }
  }
  for (const auto& [key, value] : old_values) {
    if (values.contains(key) || IsRetired(key, value)) continue;
    throw ConfigError(key,
                      "is " + value + " in " + stage + ", and no longer an option; use " + remedy);
  }
}

StageLedger::StageLedger(Database& database, const std::string& stage, const std::string& options)
    : stage_(stage), options_(options) {
  CheckStageOptions(database, stage, options);
  was_begun_ = database.ReadStage(stage).has_value();
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
                                    "' was computed; use " + Remedy(stage_));
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
