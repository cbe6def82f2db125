#include "pipeline/machines/batch.h"

#include <algorithm>

namespace cairn {

bool HeldImages::Use(image_t id) {
  const auto image = images_.find(id);
  if (image == images_.end()) return false;
  image->second.last_batch = num_batches_;
  return true;
}

void HeldImages::Add(image_t id, int64_t num_bytes) {
  images_[id] = {num_bytes, num_batches_};
  num_bytes_ += num_bytes;
}

std::vector<image_t> HeldImages::EndBatch() {
  std::vector<std::pair<int64_t, image_t>> by_use;
  if (num_bytes_ > max_bytes_) {
    for (const auto& [id, image] : images_) by_use.emplace_back(image.last_batch, id);
    std::sort(by_use.begin(), by_use.end());
  }
  for (const auto& [last_batch, id] : by_use) {
    if (num_bytes_ <= max_bytes_ || last_batch == num_batches_) break;
    num_bytes_ -= images_.at(id).num_bytes;
    images_.erase(id);
    forgotten_.push_back(id);
  }
  ++num_batches_;
  return std::exchange(forgotten_, {});
}

void HeldImages::Clear() {
  for (const auto& [id, image] : images_) forgotten_.push_back(id);
  images_.clear();
  num_bytes_ = 0;
}

void TaskBatch::Add(const PhotoTask& task) {
  tasks_(task);
  ++num_tasks_;
}

void TaskBatch::Add(const PairTask& task) {
  if (task.image1) {
    const auto [id1, id2] = PairIdToImagePair(task.pair_id);
    AddImage(id1, *task.image1);
    AddImage(id2, *task.image2);
  }
  tasks_(task, task.image1 != nullptr);
  ++num_tasks_;
}

void TaskBatch::AddImage(image_t id, const PairImage& image) {
  if (held_.Use(id)) return;
  const size_t size_before = images_.size();
  images_(id, image);
  ++num_images_;
  held_.Add(id, static_cast<int64_t>(images_.size() - size_before));
}

// The helper forgets first, so that an image can be forgotten and sent again in one message.
std::string TaskBatch::Finish() {
  ByteSink message;
  message(MessageKind::kTasks, kind_, held_.EndBatch(), num_images_);
  message.Append(images_.Take());
  message(num_tasks_);
  message.Append(tasks_.Take());
  return message.Take();
}

}  // namespace cairn
