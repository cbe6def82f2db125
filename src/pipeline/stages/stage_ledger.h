#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/run_context.h"
#include "cairn/database/database.h"
#include "report/stage.h"

namespace cairn {

// The fields of an options struct as lines "module.field = value", the names of their flags.
template <class Options>
std::string DumpQualified(const std::string& module, Options options) {
  std::vector<OptionField> fields = FieldsOf(options);
  for (OptionField& field : fields) field.name = OptionKey(module, field.name);
  return DumpFields(fields);
}

// Throws ConfigError, naming the option, if the stage ran with other options.
void CheckStageOptions(const Database& database, const std::string& stage,
                       const std::string& options);

// The state of one stage in the database: with which options it ran, and which items it finished
// from which inputs. Written only once there is something to do, so that rows of other programs
// need no record.
class StageLedger {
 public:
  // Reads the stage's rows. Throws as CheckStageOptions.
  StageLedger(Database& database, const std::string& stage, const std::string& options);

  // The item's record, or nullptr.
  const JobRecord* Find(uint64_t item) const;
  // True if the item is done from the same inputs, false if it is not done. Throws ConfigError if
  // it was done from others; `what` is what differs ("the photograph a.jpg").
  bool IsDone(uint64_t item, uint64_t input_hash, const std::string& what) const;
  // The item's record is gone from the database.
  void Forget(uint64_t item) { jobs_.erase(item); }
  [[noreturn]] void ThrowChanged(const std::string& what) const;

  // Writes the record as incomplete: work is about to begin.
  void Begin(Database& database);
  // Writes the record as complete. Nothing, if the stage never began.
  void Complete(Database& database);

 private:
  std::string stage_;
  std::string options_;
  bool was_begun_ = false;
  std::unordered_map<uint64_t, JobRecord> jobs_;
};

// Ends a stage: complete, or, where the user asked to stop, to be continued by a later run.
StageReport EndStage(Stage& stage, const RunContext& run, StageLedger& ledger, Database& database);
// Ends a stage whose ledger is written already, or that has none. Its time goes to the database.
StageReport EndStage(Stage& stage, Database& database);

}  // namespace cairn
