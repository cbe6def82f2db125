#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace cairn {

// Has tasks wait until there is memory for them beside those that run. One that runs alone may
// take more than there is.
class MemoryGate {
 public:
  explicit MemoryGate(int64_t max_bytes) : max_bytes_(std::max<int64_t>(1, max_bytes)) {}

  // A task's way through the gate, as long as it lives.
  class Pass {
   public:
    Pass(MemoryGate& gate, int64_t num_bytes)
        : gate_(gate), num_bytes_(std::min(num_bytes, gate.max_bytes_)) {
      std::unique_lock<std::mutex> lock(gate_.mutex_);
      gate_.left_.wait(lock, [this] { return gate_.num_bytes_ <= gate_.max_bytes_ - num_bytes_; });
      gate_.num_bytes_ += num_bytes_;
    }
    ~Pass() {
      {
        const std::lock_guard<std::mutex> lock(gate_.mutex_);
        gate_.num_bytes_ -= num_bytes_;
      }
      gate_.left_.notify_all();
    }
    Pass(const Pass&) = delete;
    Pass& operator=(const Pass&) = delete;

   private:
    MemoryGate& gate_;
    const int64_t num_bytes_;
  };

 private:
  const int64_t max_bytes_;
  std::mutex mutex_;
  std::condition_variable left_;
  int64_t num_bytes_ = 0;  // of the tasks that run
};

}  // namespace cairn
