#pragma once

#include <atomic>
#include <limits>
#include <mutex>
#include <string>
#include <vector>

#include "cairn/base/progress.h"

namespace cairn {

// Remembers what it was told, and asks to stop after so many items.
class TestMonitor : public ProgressMonitor {
 public:
  explicit TestMonitor(int64_t stop_after = std::numeric_limits<int64_t>::max())
      : stop_after_(stop_after) {}

  void BeginStage(const std::string& name, int64_t total) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    stages_.push_back(name);
    totals_.push_back(total);
  }
  void Advance(int64_t num_done) override { num_done_ += num_done; }
  void Info(const std::string& message) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    notes_.push_back(message);
  }
  void Warning(const std::string& message) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    warnings_.push_back(message);
  }
  bool StopRequested() const override { return num_done_ >= stop_after_; }

  int64_t num_done() const { return num_done_; }
  const std::vector<std::string>& stages() const { return stages_; }
  const std::vector<int64_t>& totals() const { return totals_; }
  const std::vector<std::string>& notes() const { return notes_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  const int64_t stop_after_;
  std::atomic<int64_t> num_done_ = 0;
  std::mutex mutex_;
  std::vector<std::string> stages_;
  std::vector<int64_t> totals_;
  std::vector<std::string> notes_, warnings_;
};

}  // namespace cairn
