#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "base/work_queue.h"
#include "cairn/base/types.h"
#include "cairn/camera/camera.h"
#include "cairn/matching/matching.h"
#include "cairn/scene/features.h"
#include "pipeline/pairs/plan.h"

namespace cairn {

// What a stage over pairs needs of one image.
struct PairImage {
  Camera camera;
  std::vector<Keypoint> keypoints;
  std::vector<DepthSample> depth;  // empty: the image has no depth
  Descriptors descriptors;
  Polarities polarities;
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
  void Stop() { queue_.Stop(); }

 private:
  void Read();

  const std::vector<PairTile> plan_;
  const LoadImage load_image_;
  const LoadPair load_pair_;
  std::atomic<int64_t> num_left_;
  WorkQueue<PairTask> queue_;
  std::thread thread_;
};

}  // namespace cairn
