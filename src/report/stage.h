#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/base/progress.h"
#include "cairn/base/timer.h"
#include "cairn/report/run_report.h"

namespace cairn {

// One stage of a run: timed, its messages shown by the monitor and kept in its report.
class Stage {
 public:
  Stage(ProgressMonitor& monitor, const std::string& name);
  Stage(const Stage&) = delete;

  StageReport& Add(const std::string& key, double value) { return report_.Add(key, value); }
  // A line for the user, kept in the report.
  void Note(const std::string& message);
  void Warn(const std::string& message);
  // A line each for many things: the user sees the first ten, the report keeps all.
  void NoteEach(const std::vector<std::string>& messages);
  void WarnEach(const std::vector<std::string>& messages);
  // Of the whole run: shown, and kept for RunReport::warnings.
  void Warn(const ResultWarning& warning);
  // For the report alone. The user sees warnings of the whole run at its end.
  void Record(const std::string& message) { report_.messages.push_back(message); }
  void RecordWarning(const std::string& message);
  void RecordWarning(const ResultWarning& warning);
  // The user asked to stop, or there is nothing to do.
  void MarkStopped() { report_.MarkStopped(); }
  void MarkSkipped() { report_.status = StageStatus::kSkipped; }
  // The report, with the time until now. The stage is over.
  StageReport Finish();

 protected:
  ProgressMonitor& monitor_;
  StageReport report_;

 private:
  Timer timer_;
};

// A stage that the monitor shows under its name, put in the run's report when it ends.
class RunStage : public Stage {
 public:
  RunStage(RunReport& run, ProgressMonitor& monitor, const std::string& name, int64_t total = 0);
  ~RunStage();

  // Ends the run: what was there, what the user can try.
  void Fail(const std::string& what_was_there, const std::string& what_to_try);

 private:
  RunReport& run_;
};

}  // namespace cairn
