#include "pipeline/depth_learning.h"

#include <algorithm>
#include <map>
#include <mutex>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/pipeline/pair_scheduler.h"
#include "pipeline/depth_choice.h"
#include "pipeline/pair_feed.h"

namespace cairn {
namespace {

// Reads verified pairs in the reading thread of a PairFeed, with a connection of its own.
class WitnessLoader {
 public:
  explicit WitnessLoader(const std::string& database_path)
      : database_(database_path, Database::Mode::kReadOnly) {
    for (Camera& camera : database_.ReadCameras()) {
      const camera_t id = camera.camera_id;
      cameras_[id] = std::move(camera);
    }
    for (const Image& image : database_.ReadImages()) {
      camera_ids_[image.image_id] = image.camera_id;
    }
  }

  PairImage LoadImage(image_t id) const {
    PairImage loaded;
    try {
      loaded.camera = cameras_.at(camera_ids_.at(id));
      loaded.keypoints = database_.ReadKeypoints(id).value();
      while (auto samples =
                 database_.ReadDepthSamples(id, static_cast<int>(loaded.depth_scales.size()))) {
        loaded.is_damaged |= samples->size() != loaded.keypoints.size();
        loaded.depth_scales.push_back(std::move(*samples));
      }
    } catch (const IoError&) {  // The verification of its pairs has reported it.
      loaded.is_damaged = true;
    }
    return loaded;
  }

  // False: the pair has no pose, no inliers, or an image without depth.
  bool LoadPair(PairTask& task, const std::function<PairFeed::ImagePtr(image_t)>& image) const {
    try {
      auto geometry = database_.ReadTwoViewGeometry(task.pair_id);
      if (!geometry || geometry->config != TwoViewConfig::kCalibrated ||
          !geometry->cam2_from_cam1 || geometry->cam2_from_cam1->translation.isZero() ||
          geometry->inlier_matches.empty()) {
        return false;
      }
      task.matches = std::move(geometry->inlier_matches);
      task.cam2_from_cam1 = *geometry->cam2_from_cam1;
    } catch (const IoError&) {
      return false;
    }
    const auto [id1, id2] = PairIdToImagePair(task.pair_id);
    task.image1 = image(id1);
    task.image2 = image(id2);
    for (const auto& loaded : {task.image1, task.image2}) {
      if (loaded->is_damaged || loaded->depth_scales.empty()) return false;
    }
    for (const FeatureMatch& match : task.matches) {
      if (match.point1 >= task.image1->keypoints.size() ||
          match.point2 >= task.image2->keypoints.size()) {
        return false;
      }
    }
    return true;
  }

 private:
  Database database_;
  std::map<camera_t, Camera> cameras_;
  std::map<image_t, camera_t> camera_ids_;
};

DepthEvidence Collect(const PairTask& task) {
  return CollectDepthEvidence(
      {&task.image1->camera, task.image1->keypoints, task.image1->depth_scales},
      {&task.image2->camera, task.image2->keypoints, task.image2->depth_scales}, task.matches,
      task.cam2_from_cam1);
}

// The pairs between images with depth that can teach about at least one of them.
std::vector<image_pair_t> FindPairs(const std::vector<image_pair_t>& pairs,
                                    const std::map<image_t, int>& num_samples,
                                    const std::map<image_t, ImageDepth>& known) {
  std::vector<image_pair_t> found;
  for (const image_pair_t pair : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    if (num_samples.count(id1) == 0 || num_samples.count(id2) == 0) continue;
    if (known.count(id1) == 0 || known.count(id2) == 0) found.push_back(pair);
  }
  return found;
}

int64_t NumMatches(const std::vector<std::pair<image_pair_t, int>>& num_matches,
                   image_pair_t pair) {
  return std::lower_bound(num_matches.begin(), num_matches.end(), std::pair(pair, 0))->second;
}

// A keypoint with its samples; most databases have three scales.
constexpr int64_t kBytesPerKeypoint = sizeof(Keypoint) + 3 * sizeof(DepthSample);

}  // namespace

void LearnDepth(Database& database, const std::vector<image_pair_t>& pairs,
                const std::vector<std::pair<image_pair_t, int>>& num_matches, int64_t max_bytes,
                int num_threads, ProgressMonitor& monitor) {
  const std::map<image_t, int> num_samples = database.ReadNumDepthSamples();
  const std::map<image_t, ImageDepth> known = database.ReadImageDepth();
  const std::vector<image_pair_t> found = FindPairs(pairs, num_samples, known);
  if (found.empty()) return;
  std::map<image_t, int64_t> image_bytes;
  for (const auto& [id, num] : num_samples) image_bytes[id] = num * kBytesPerKeypoint;
  const WitnessLoader loader(database.path());
  std::map<image_pair_t, PairDepthEvidence> evidence;
  std::mutex evidence_mutex;
  PairFeed feed(
      PlanPairTiles(found, image_bytes, max_bytes),
      [&loader](image_t id) { return loader.LoadImage(id); },
      [&loader](PairTask& task, const auto& image) { return loader.LoadPair(task, image); },
      max_bytes / 8);
  ParallelForWorker(EffectiveNumThreads(num_threads), std::ssize(found), [&](int, int64_t) {
    if (monitor.StopRequested()) feed.Stop();
    const std::optional<PairTask> task = feed.Next();
    if (!task) return;
    PairDepthEvidence pair = {Collect(*task), 0};
    pair.num_hypotheses = pair.evidence.num_samples * NumMatches(num_matches, task->pair_id) /
                          std::ssize(task->matches);
    const std::lock_guard<std::mutex> lock(evidence_mutex);
    evidence[task->pair_id] = std::move(pair);
  });
  if (monitor.StopRequested()) return;
  const std::map<image_t, ImageDepth> learned = ChooseDepth(evidence, known);
  if (learned.empty()) return;
  Database::Transaction transaction(database);
  for (const auto& [id, depth] : learned) database.WriteImageDepth(id, depth);
  transaction.Commit();
  monitor.Info("learned the depth of " + LearnedDepthText(learned));
}

}  // namespace cairn
