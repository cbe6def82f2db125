#include "base/thread_pool.h"

#include <exception>

namespace cairn {
namespace {

// A thread that waits for another looks so often whether it has come before it sleeps: for about as
// long as it takes to be woken.
constexpr int kLooks = 100;

template <class HasCome>
void LookFor(const HasCome& has_come) {
  for (int k = 0; k < kLooks && !has_come(); ++k) std::this_thread::yield();
}

}  // namespace

ThreadPool& ThreadPool::Get() {
  static ThreadPool& pool = *new ThreadPool;
  return pool;
}

int ThreadPool::Grow(int num_helpers) {
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    while (!is_full_ && static_cast<int>(helpers_.size()) < num_helpers) {
      helpers_.emplace_back([this] { Help(); });
    }
  } catch (const std::exception&) {  // std::system_error or std::bad_alloc: these are all
    is_full_ = true;  // for good: loops have as many slots as the first call told them
  }
  return static_cast<int>(helpers_.size());
}

void ThreadPool::Run(int num_workers, const std::function<void(int)>& body) {
  Loop loop{body, num_workers};
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    open_.push_back(&loop);
    ++num_open_;
  }
  for (int worker = 1; worker < num_workers; ++worker) opened_.notify_one();
  body(0);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    num_open_ -= static_cast<int>(std::erase(open_, &loop));
  }
  LookFor([&] { return loop.num_running == 0; });
  std::unique_lock<std::mutex> lock(mutex_);
  ended_.wait(lock, [&] { return loop.num_running == 0; });
}

void ThreadPool::Help() {
  for (;;) {
    LookFor([this] { return num_open_ > 0; });
    std::unique_lock<std::mutex> lock(mutex_);
    opened_.wait(lock, [this] { return !open_.empty(); });
    Loop& loop = *open_.front();
    const int worker = loop.next_worker++;
    ++loop.num_running;
    if (loop.next_worker == loop.num_workers) {
      open_.pop_front();
      --num_open_;
    }
    lock.unlock();
    loop.body(worker);
    lock.lock();
    if (--loop.num_running == 0) ended_.notify_all();
  }
}

}  // namespace cairn
