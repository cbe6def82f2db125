#pragma once

#include <cstdint>
#include <string>

#include "cairn/base/progress.h"
#include "cairn/base/timer.h"
#include "cairn/report/run_report.h"

namespace cairn {

// One stage of a run: shown by the monitor, timed, and put in the run's report when it ends.
class Stage {
 public:
  Stage(RunReport& report, ProgressMonitor& monitor, const std::string& name, int64_t total = 0);
  ~Stage();
  Stage(const Stage&) = delete;

  StageReport& Add(const std::string& key, double value) { return report_.Add(key, value); }
  // A line for the user, kept in the report.
  void Note(const std::string& message);
  void Warn(const std::string& message);
  // Ends the run: what was there, what the user can try.
  void Fail(const std::string& what_was_there, const std::string& what_to_try);

 private:
  RunReport& run_;
  ProgressMonitor& monitor_;
  StageReport report_;
  Timer timer_;
};

}  // namespace cairn
