#include "pipeline/depth_learning.h"

#include <algorithm>
#include <map>
#include <mutex>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/pipeline/pair_scheduler.h"
#include "pipeline/depth_choice.h"
#include "pipeline/learned_cameras.h"
#include "pipeline/pair_feed.h"

namespace cairn {
namespace {

// A verified pair, with some of its inliers.
struct Witness {
  Rigid3d cam2_from_cam1;
  FeatureMatches inliers;
  int64_t num_inliers = 0;  // all of them
};

// Enough, where some have no depth: 40 of a pair are looked at (depth_evidence.h).
constexpr size_t kMaxInliers = 60;

// Of the pairs between images with depth that can teach about at least one of them, those that are
// verified with a pose.
std::map<image_pair_t, Witness> FindWitnesses(const Database& database,
                                              const std::vector<image_pair_t>& pairs,
                                              const std::map<image_t, int>& num_samples,
                                              const std::map<image_t, ImageDepth>& known) {
  std::map<image_pair_t, Witness> witnesses;
  for (const image_pair_t pair : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    if (num_samples.count(id1) == 0 || num_samples.count(id2) == 0) continue;
    if (known.count(id1) > 0 && known.count(id2) > 0) continue;
    try {
      const auto geometry = database.ReadTwoViewGeometry(pair);
      if (!geometry || geometry->config != TwoViewConfig::kCalibrated ||
          !geometry->cam2_from_cam1 || geometry->cam2_from_cam1->translation.isZero()) {
        continue;
      }
      const FeatureMatches& inliers = geometry->inlier_matches;
      Witness witness = {*geometry->cam2_from_cam1, {}, std::ssize(inliers)};
      const size_t step = std::max<size_t>(1, inliers.size() / kMaxInliers);
      for (size_t i = 0; i < inliers.size(); i += step) witness.inliers.push_back(inliers[i]);
      if (!inliers.empty()) witnesses[pair] = std::move(witness);
    } catch (const IoError&) {  // The row says nothing.
    }
  }
  return witnesses;
}

// The keypoints of each image that witnesses need, ascending.
std::map<image_t, std::vector<point2D_t>> FindNeeded(
    const std::map<image_pair_t, Witness>& witnesses) {
  std::map<image_t, std::vector<point2D_t>> needed;
  for (const auto& [pair, witness] : witnesses) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    for (const FeatureMatch& match : witness.inliers) {
      needed[id1].push_back(match.point1);
      needed[id2].push_back(match.point2);
    }
  }
  for (auto& [id, points] : needed) {
    std::sort(points.begin(), points.end());
    points.erase(std::unique(points.begin(), points.end()), points.end());
  }
  return needed;
}

// The rows with these indices; nothing if one is beyond the end.
template <class Row>
std::vector<Row> Select(const std::vector<Row>& rows, const std::vector<point2D_t>& indices) {
  std::vector<Row> selected;
  if (indices.back() >= rows.size()) return selected;
  for (const point2D_t index : indices) selected.push_back(rows[index]);
  return selected;
}

point2D_t PositionOf(point2D_t index, const std::vector<point2D_t>& indices) {
  return static_cast<point2D_t>(std::lower_bound(indices.begin(), indices.end(), index) -
                                indices.begin());
}

// Reads what witnesses need of their images, in the reading thread of a PairFeed, with a connection
// of its own.
class WitnessLoader {
 public:
  WitnessLoader(const std::string& database_path, const std::map<image_pair_t, Witness>& witnesses)
      : database_(database_path, Database::Mode::kReadOnly),
        witnesses_(witnesses),
        needed_(FindNeeded(witnesses)) {
    std::map<camera_t, Camera> cameras;
    for (Camera& camera : ReadLearnedCameras(database_)) cameras[camera.camera_id] = camera;
    for (const Image& image : database_.ReadImages()) {
      cameras_[image.image_id] = cameras[image.camera_id];
    }
  }

  std::map<image_t, int64_t> ImageBytes() const {
    constexpr int64_t kBytesPerKeypoint = sizeof(Keypoint) + 3 * sizeof(DepthSample);
    std::map<image_t, int64_t> bytes;
    for (const auto& [id, points] : needed_) bytes[id] = std::ssize(points) * kBytesPerKeypoint;
    return bytes;
  }

  // Only the keypoints that are needed, and their samples at every scale.
  PairImage LoadImage(image_t id) const {
    PairImage loaded;
    const std::vector<point2D_t>& needed = needed_.at(id);
    try {
      const auto camera = cameras_.find(id);
      const auto keypoints = database_.ReadKeypoints(id);
      if (camera != cameras_.end()) loaded.camera = camera->second;
      loaded.keypoints = std::make_shared<const std::vector<Keypoint>>(
          keypoints ? Select(*keypoints, needed) : std::vector<Keypoint>());
      loaded.is_damaged = loaded.keypoints->empty() || loaded.camera.params.empty();
      for (int scale = 0; const auto samples = database_.ReadDepthSamples(id, scale); ++scale) {
        loaded.depth_scales.push_back(Select(*samples, needed));
        loaded.is_damaged |= loaded.depth_scales.back().empty();
      }
    } catch (const IoError&) {  // The verification of its pairs has reported it.
      loaded.is_damaged = true;
    }
    return loaded;
  }

  // False: a row of an image cannot be read.
  bool LoadPair(PairTask& task, const std::function<PairFeed::ImagePtr(image_t)>& image) const {
    const auto [id1, id2] = PairIdToImagePair(task.pair_id);
    task.image1 = image(id1);
    task.image2 = image(id2);
    for (const FeatureMatch& match : witnesses_.at(task.pair_id).inliers) {
      task.matches.push_back(
          {PositionOf(match.point1, needed_.at(id1)), PositionOf(match.point2, needed_.at(id2))});
    }
    return !task.image1->is_damaged && !task.image2->is_damaged;
  }

 private:
  Database database_;
  const std::map<image_pair_t, Witness>& witnesses_;
  const std::map<image_t, std::vector<point2D_t>> needed_;
  std::map<image_t, Camera> cameras_;
};

DepthEvidence Collect(const PairTask& task, const Rigid3d& cam2_from_cam1) {
  return CollectDepthEvidence(
      {&task.image1->camera, *task.image1->keypoints, task.image1->depth_scales},
      {&task.image2->camera, *task.image2->keypoints, task.image2->depth_scales}, task.matches,
      cam2_from_cam1);
}

int64_t NumMatches(const std::vector<std::pair<image_pair_t, int>>& num_matches,
                   image_pair_t pair) {
  return std::lower_bound(num_matches.begin(), num_matches.end(), std::pair(pair, 0))->second;
}

}  // namespace

void LearnDepth(Database& database, const std::vector<image_pair_t>& pairs,
                const std::vector<std::pair<image_pair_t, int>>& num_matches, int64_t max_bytes,
                int num_threads, ProgressMonitor& monitor) {
  const std::map<image_t, int> num_samples = database.ReadNumDepthSamples();
  const std::map<image_t, ImageDepth> known = database.ReadImageDepth();
  const std::map<image_pair_t, Witness> witnesses =
      FindWitnesses(database, pairs, num_samples, known);
  if (witnesses.empty()) return;
  const WitnessLoader loader(database.path(), witnesses);
  std::vector<image_pair_t> verified;
  for (const auto& [pair, witness] : witnesses) verified.push_back(pair);
  std::map<image_pair_t, PairDepthEvidence> evidence;
  std::mutex evidence_mutex;
  PairFeed feed(
      PlanPairTiles(verified, loader.ImageBytes(), max_bytes),
      [&loader](image_t id) { return loader.LoadImage(id); },
      [&loader](PairTask& task, const auto& image) { return loader.LoadPair(task, image); },
      max_bytes / 8);
  ParallelForWorker(EffectiveNumThreads(num_threads), std::ssize(verified), [&](int, int64_t) {
    if (monitor.StopRequested()) feed.Stop();
    const std::optional<PairTask> task = feed.Next();
    if (!task) return;
    const Witness& witness = witnesses.at(task->pair_id);
    PairDepthEvidence pair = {Collect(*task, witness.cam2_from_cam1), 0};
    pair.num_hypotheses =
        pair.evidence.num_samples * NumMatches(num_matches, task->pair_id) / witness.num_inliers;
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
