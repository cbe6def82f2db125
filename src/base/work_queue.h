#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <limits>
#include <mutex>
#include <optional>
#include <utility>

namespace cairn {

// Values on their way between threads, in the order of their arrival. Any thread may call.
template <class T>
class WorkQueue {
 public:
  using Time = std::chrono::steady_clock::time_point;

  // Push waits while so many values are waiting, or so many bytes of them.
  explicit WorkQueue(size_t max_size = std::numeric_limits<size_t>::max(),
                     int64_t max_bytes = std::numeric_limits<int64_t>::max())
      : max_size_(max_size), max_bytes_(max_bytes) {}

  // False: the queue was stopped. Throws the error that it was stopped with.
  bool Push(T value, int64_t num_bytes = 0) {
    std::unique_lock<std::mutex> lock(mutex_);
    taken_.wait(lock, [&] {
      return is_stopped_ || values_.empty() ||
             (values_.size() < max_size_ && num_bytes_ <= max_bytes_ - num_bytes);
    });
    if (error_) std::rethrow_exception(error_);
    if (is_stopped_) return false;
    values_.emplace_back(std::move(value), num_bytes);
    num_bytes_ += num_bytes;
    lock.unlock();
    arrived_.notify_one();
    return true;
  }

  // The next value; nullopt: no more will come, or none has come by `deadline`. Throws the error
  // that the queue was stopped with.
  std::optional<T> Next(Time deadline = Time::max()) {
    std::unique_lock<std::mutex> lock(mutex_);
    arrived_.wait_until(lock, deadline,
                        [this] { return is_stopped_ || is_finished_ || !values_.empty(); });
    if (error_) std::rethrow_exception(error_);
    if (is_stopped_ || values_.empty()) return std::nullopt;
    auto [value, num_bytes] = std::move(values_.front());
    values_.pop_front();
    num_bytes_ -= num_bytes;
    lock.unlock();
    taken_.notify_one();
    return std::move(value);
  }

  // No more values come after those that are waiting.
  void Finish() { End(is_finished_, nullptr); }
  // Drops what is waiting; nobody waits from now on.
  void Stop(std::exception_ptr error = nullptr) { End(is_stopped_, error); }

  // Values that are waiting.
  int64_t NumLeft() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return static_cast<int64_t>(values_.size());
  }
  bool IsStopped() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return is_stopped_;
  }

 private:
  void End(bool& is_over, const std::exception_ptr& error) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      is_over = true;
      if (error) error_ = error;
    }
    arrived_.notify_all();
    taken_.notify_all();
  }

  const size_t max_size_;
  const int64_t max_bytes_;
  mutable std::mutex mutex_;
  std::condition_variable arrived_, taken_;
  std::deque<std::pair<T, int64_t>> values_;
  int64_t num_bytes_ = 0;
  bool is_finished_ = false, is_stopped_ = false;
  std::exception_ptr error_;
};

}  // namespace cairn
