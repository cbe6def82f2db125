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
      num_left_(CountPairs(plan_)),
      queue_(kMaxQueueSize, max_queue_bytes),
      thread_([this] { Read(); }) {}

PairFeed::~PairFeed() {
  Stop();
  thread_.join();
}

void PairFeed::Read() {
  try {
    std::map<image_t, ImagePtr> images;  // of the present tile
    const auto image = [&](image_t id) -> ImagePtr {
      ImagePtr& slot = images[id];
      if (!slot) slot = std::make_shared<const PairImage>(load_image_(id));
      return slot;
    };
    for (const PairTile& tile : plan_) {
      std::erase_if(images, [&tile](const auto& entry) {
        return !std::binary_search(tile.images.begin(), tile.images.end(), entry.first);
      });
      for (const image_pair_t pair_id : tile.pairs) {
        if (queue_.IsStopped()) return;
        PairTask task;
        task.pair_id = pair_id;
        if (load_pair_(task, image)) {
          const int64_t num_bytes = TaskBytes(task);
          queue_.Push(std::move(task), num_bytes);
        } else {
          --num_left_;
        }
      }
    }
    queue_.Finish();
  } catch (...) {
    queue_.Stop(std::current_exception());
  }
}

std::optional<PairTask> PairFeed::Next() {
  std::optional<PairTask> task = queue_.Next();
  if (task) --num_left_;
  return task;
}

}  // namespace cairn
