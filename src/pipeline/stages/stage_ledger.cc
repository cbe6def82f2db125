#include "pipeline/stages/stage_ledger.h"

#include <map>
#include <sstream>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/base/options.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

// Throws ConfigError for the first option, in the order of the present ones, that differs.
void CheckOptions(const StageRecord& stored, const std::string& present) {
  if (stored.options == present) return;
  const std::string& stage = stored.stage;
  const std::map<std::string, std::string> old_values = stored.OptionValues();
  const std::string advice = "; use the same, or --recompute " + stage;
  std::istringstream lines(present);
  std::string line;
  while (std::getline(lines, line)) {
    const size_t equals = line.find(" = ");
    const std::string key = line.substr(0, equals);
    const std::string value = line.substr(equals + 3);
    const auto old_value = old_values.find(key);
    if (old_value == old_values.end() && value == ImpliedValue(key)) continue;
    if (old_value == old_values.end()) {
      throw ConfigError(key, "the database's stage '" + stage +
                                 "' was made by a version without this option; use --recompute " +
                                 stage);
    }
    if (old_value->second != value) {
      throw ConfigError(key, "is " + value + ", but the database's stage '" + stage +
                                 "' was made with " + old_value->second + advice);
    }
  }
  const auto values = StageRecord{stage, present, 0, false}.OptionValues();
  for (const auto& [key, value] : old_values) {
    if (values.count(key) > 0 || value == '"' + RetiredValue(key) + '"') continue;
    throw ConfigError(key, "is " + value + " in the database's stage '" + stage +
                               "', and no longer an option; use --recompute " + stage);
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
  database.WriteStage({stage_, options_, 0, false});
  was_begun_ = true;
}

void StageLedger::Complete(Database& database) {
  if (!was_begun_) return;
  Hasher hasher;
  hasher.Add(options_);
  for (const JobRecord& job : database.ReadJobs(stage_)) {
    hasher.Add(job.item).Add(job.input_hash).Add(job.note);
  }
  database.WriteStage({stage_, options_, hasher.Digest(), true});
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
  database.AddTiming(report.name, 0, "", report.seconds);
  return report;
}

std::vector<std::string> StageAndDependents(const std::string& stage) {
  if (stage == kStageFeatures) {
    return {kStageFeatures, kStageDepth, kStagePairs, kStageMatching, kStageVerification};
  }
  if (stage == kStagePairs) return {kStagePairs, kStageMatching, kStageVerification};
  if (stage == kStageVerification) return {kStageVerification};
  return {stage, kStageVerification};
}

void ClearStageAndDependents(Database& database, const std::string& stage) {
  for (const std::string& cleared : StageAndDependents(stage)) {
    if (cleared == kStageFeatures) database.ClearFeatures();
    if (cleared == kStageDepth) database.ClearDepth();
    if (cleared == kStagePairs) database.ClearPairChoices();
    if (cleared == kStageMatching) database.ClearMatches();
    if (cleared == kStageVerification) database.ClearVerification();
    database.ClearStage(cleared);
  }
}

}  // namespace cairn
