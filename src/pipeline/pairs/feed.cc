#include "pipeline/pairs/feed.h"

#include <algorithm>
#include <utility>

namespace cairn {
namespace {

// What a waiting task weighs; the constant stands for the task itself.
int64_t TaskBytes(const PairTask& task) {
  return 128 + static_cast<int64_t>(task.matches.size() * sizeof(FeatureMatch));
}

int64_t CountPairs(const std::vector<PairTile>& plan) {
  int64_t num = 0;
  for (const PairTile& tile : plan) num += std::ssize(tile.pairs);
  return num;
}

// At most so many tasks wait: enough to keep all threads busy, few enough to stop quickly.
constexpr size_t kMaxQueueSize = 1024;

}  // namespace

PairFeed::PairFeed(std::vector<PairTile> plan, LoadImage load_image, LoadPair load_pair,
                   int64_t max_queue_bytes)
    : plan_(std::move(plan)),
      load_image_(std::move(load_image)),
      load_pair_(std::move(load_pair)),
      max_queue_bytes_(max_queue_bytes),
      num_left_(CountPairs(plan_)),
      thread_([this] { Read(); }) {}

PairFeed::~PairFeed() {
  Stop();
  thread_.join();
}

void PairFeed::Read() {
  try {
    const auto image = [this](image_t id) -> ImagePtr {
      ImagePtr& slot = images_[id];
      if (!slot) slot = std::make_shared<const PairImage>(load_image_(id));
      return slot;
    };
    for (const PairTile& tile : plan_) {
      std::erase_if(images_, [&tile](const auto& entry) {
        return !std::binary_search(tile.images.begin(), tile.images.end(), entry.first);
      });
      for (const image_pair_t pair_id : tile.pairs) {
        PairTask task;
        task.pair_id = pair_id;
        if (!load_pair_(task, image)) {
          --num_left_;
        } else if (!Push(std::move(task))) {
          return;
        }
        if (is_stopped_) return;
      }
    }
  } catch (...) {
    const std::lock_guard<std::mutex> lock(mutex_);
    error_ = std::current_exception();
  }
  images_.clear();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_over_ = true;
  }
  task_arrived_.notify_all();
}

bool PairFeed::Push(PairTask task) {
  const int64_t bytes = TaskBytes(task);
  std::unique_lock<std::mutex> lock(mutex_);
  task_taken_.wait(lock, [&] {
    return is_stopped_ || queue_.empty() ||
           (queue_bytes_ + bytes <= max_queue_bytes_ && queue_.size() < kMaxQueueSize);
  });
  if (is_stopped_) return false;
  queue_bytes_ += bytes;
  queue_.push_back(std::move(task));
  lock.unlock();
  task_arrived_.notify_one();
  return true;
}

std::optional<PairTask> PairFeed::Next() {
  std::unique_lock<std::mutex> lock(mutex_);
  task_arrived_.wait(lock, [this] { return !queue_.empty() || is_over_ || is_stopped_; });
  if (error_) std::rethrow_exception(error_);
  if (is_stopped_ || queue_.empty()) return std::nullopt;
  PairTask task = std::move(queue_.front());
  queue_.pop_front();
  queue_bytes_ -= TaskBytes(task);
  --num_left_;
  lock.unlock();
  task_taken_.notify_one();
  return task;
}

void PairFeed::Stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_stopped_ = true;
  }
  task_taken_.notify_all();
  task_arrived_.notify_all();
}

}  // namespace cairn
