#pragma once

#include <chrono>
#include <mutex>
#include <string>

#include "cairn/base/progress.h"

namespace cairn {

// Shows progress, messages and warnings on the error stream: one line that is rewritten on a
// terminal, a line now and then elsewhere, each with percent and time left, and a line for each
// stage of a second and more. From construction on,
// the first Ctrl-C (or SIGTERM) makes StopRequested true, and ends the program (exit code 1) if it
// has not stopped within a second; the second ends it at once. One per program.
class ConsoleMonitor : public ProgressMonitor {
 public:
  ConsoleMonitor();
  ~ConsoleMonitor() override;

  void BeginStage(const std::string& name, int64_t total) override;
  void Advance(int64_t num_done) override;
  void EndStage() override;
  void Info(const std::string& message) override;
  void Warning(const std::string& message) override;
  bool StopRequested() const override;

 private:
  using Clock = std::chrono::steady_clock;
  void ShowProgress(Clock::time_point now);
  void ClearLine();

  std::mutex mutex_;
  bool is_terminal_;
  bool line_is_open_ = false;
  std::string stage_;
  int64_t total_ = 0;
  int64_t done_ = 0;
  Clock::time_point stage_start_;
  Clock::time_point last_shown_;
};

// "75 s", "12 min", "3.4 h".
std::string FormatDuration(double seconds);

}  // namespace cairn
