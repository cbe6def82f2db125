#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "cairn/base/types.h"
#include "cairn/camera/camera.h"
#include "cairn/matching/matching.h"
#include "cairn/scene/features.h"
#include "pipeline/pairs/plan.h"

namespace cairn {

// What a stage over pairs needs of one image.
struct PairImage {
  Camera camera;
  std::shared_ptr<const std::vector<Keypoint>> keypoints;  // none if the image is damaged
  std::vector<DepthSample> depth;                          // empty: the image has no depth
  Descriptors descriptors;
  uint64_t content_hash = 0;
  bool is_damaged = false;  // a row of it cannot be read: its pairs are left out
};

// A pair with everything that its computation needs; each stage fills what it uses.
struct PairTask {
  image_pair_t pair_id = 0;
  std::shared_ptr<const PairImage> image1;
  std::shared_ptr<const PairImage> image2;
  FeatureMatches matches;
  bool are_best_first = false;  // PairInput::are_best_first
  bool weigh_focals = false;    // likewise
  uint64_t input_hash = 0;
};

// Reads pairs in the order of a plan, in a thread of its own, ahead of those who take them. Images
// are read once a tile and kept while their tile lasts; waiting tasks hold at most max_queue_bytes
// of matches.
class PairFeed {
 public:
  using ImagePtr = std::shared_ptr<const PairImage>;
  // Both run in the reading thread. `image` gives (and keeps) an image of the tile. LoadPair fills
  // a task whose pair_id is set; false: there is nothing to do for this pair.
  using LoadImage = std::function<PairImage(image_t)>;
  using LoadPair =
      std::function<bool(PairTask& task, const std::function<ImagePtr(image_t)>& image)>;

  PairFeed(std::vector<PairTile> plan, LoadImage load_image, LoadPair load_pair,
           int64_t max_queue_bytes);
  // Ends the reading thread; what is waiting is dropped.
  ~PairFeed();

  // The next task; nullopt when there are no more. Throws what reading threw. Any thread may call.
  std::optional<PairTask> Next();
  // Tasks that are still to come, at most.
  int64_t NumLeft() const { return num_left_; }
  // No more tasks come after this.
  void Stop();

 private:
  void Read();
  bool Push(PairTask task);  // false: stopped

  const std::vector<PairTile> plan_;
  const LoadImage load_image_;
  const LoadPair load_pair_;
  const int64_t max_queue_bytes_;
  std::mutex mutex_;
  std::condition_variable task_arrived_;
  std::condition_variable task_taken_;
  std::deque<PairTask> queue_;
  int64_t queue_bytes_ = 0;
  std::atomic<int64_t> num_left_ = 0;
  bool is_over_ = false;
  std::atomic<bool> is_stopped_ = false;
  std::exception_ptr error_;
  std::map<image_t, ImagePtr> images_;  // of the present tile; the reading thread's own
  std::thread thread_;
};

}  // namespace cairn
