#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cairn {

enum class StageStatus : int {
  kOk = 0,
  kWarning,  // done, with something the user should know
  kFailed,   // no usable result
  kStopped,  // by the user; a later run continues
  kSkipped,  // not needed
};
std::string_view StageStatusName(StageStatus status);

// What is doubtful about a result, or wrong.
struct ResultWarning {
  std::string what;
  std::string advice;  // what the user can try; "": what says it all
  bool is_wrong = false;
};

// What, and behind a semicolon the advice.
std::string WarningText(const ResultWarning& warning);

// What one stage did. `values` are counts in and out and residuals, in the order they were added.
struct StageReport {
  std::string name;
  StageStatus status = StageStatus::kOk;
  double seconds = 0;
  double memory_gib = 0;  // resident size of the program when it ended, 0 if unknown
  std::vector<std::pair<std::string, double>> values;
  std::vector<std::string> messages;    // reasons, skipped items, what the user can try
  std::vector<ResultWarning> warnings;  // of the run, for RunReport

  StageReport& Add(const std::string& key, double value) {
    values.emplace_back(key, value);
    return *this;
  }
  // 0 for a key that is not there.
  double Value(std::string_view key) const;
  void MarkStopped() {
    status = StageStatus::kStopped;
    messages.push_back("stopped; run again to continue");
  }
  bool WasStopped() const { return status == StageStatus::kStopped; }
};

// What a program's run did, stage by stage.
struct RunReport {
  std::string program;
  uint64_t seed = 0;
  int num_threads = 0;
  std::vector<StageReport> stages;
  std::vector<std::pair<std::string, double>> values;  // of the whole run
  std::vector<ResultWarning> warnings;
  std::string failure;  // "" or: at which stage, what was there, what the user can try

  bool Succeeded() const { return failure.empty(); }
};

// JSON with two blanks of indentation, keys in order, trailing newline.
std::string ToJson(const RunReport& report);

}  // namespace cairn
