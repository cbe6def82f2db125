#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "pipeline/machines/messages.h"

namespace cairn {

// Which images a helper has, so that none is sent twice while it has it.
class HeldImages {
 public:
  // The helper keeps at most so many bytes, but always the images of the last batch.
  explicit HeldImages(int64_t max_bytes) : max_bytes_(max_bytes) {}

  // Marks the image as needed by the batch in progress. True: the helper has it already.
  bool Use(image_t id);
  void Add(image_t id, int64_t num_bytes);
  // Ends the batch: those that the helper is to forget now, the longest unused first.
  std::vector<image_t> EndBatch();
  // All are to be forgotten with the next batch.
  void Clear();

 private:
  struct Image {
    int64_t num_bytes = 0;
    int64_t last_batch = 0;
  };

  const int64_t max_bytes_;
  std::map<image_t, Image> images_;
  std::vector<image_t> forgotten_;
  int64_t num_bytes_ = 0;
  int64_t num_batches_ = 0;
};

// Tasks for one helper, with the images that they need and it lacks, as one message.
class TaskBatch {
 public:
  TaskBatch(TaskKind kind, HeldImages& held) : kind_(kind), held_(held) {}

  void Add(const PhotoTask& task);
  void Add(const PairTask& task);

  int64_t num_tasks() const { return num_tasks_; }
  int64_t NumBytes() const { return static_cast<int64_t>(images_.size() + tasks_.size()); }
  // The message; the batch is spent.
  std::string Finish();

 private:
  void AddImage(image_t id, const PairImage& image);

  const TaskKind kind_;
  HeldImages& held_;
  ByteSink images_, tasks_;
  int64_t num_images_ = 0, num_tasks_ = 0;
};

}  // namespace cairn
