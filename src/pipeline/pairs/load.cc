#include "pipeline/pairs/load.h"

#include "base/hash.h"
#include "cairn/base/error.h"

namespace cairn {
namespace {

// What the geometry of a pair depends on; not the camera's id.
uint64_t HashCamera(const Camera& camera) {
  Hasher hasher;
  hasher.Add(static_cast<int>(camera.model)).Add(camera.width).Add(camera.height);
  for (const double param : camera.params) hasher.Add(param);
  return hasher.Add(camera.has_prior_focal_length ? 1 : 0).Digest();
}

}  // namespace

PairLoader::PairLoader(const std::string& database_path, int min_num_matches,
                       const StageLedger& ledger, Stage& stage)
    : database_(database_path, Database::Mode::kReadOnly),
      min_num_matches_(min_num_matches),
      ledger_(ledger),
      stage_(stage),
      origins_(database_) {
  for (Camera& camera : database_.ReadCameras()) {
    const camera_t id = camera.camera_id;
    cameras_[id] = std::move(camera);
  }
  for (Image& image : database_.ReadImages()) {
    const image_t id = image.image_id;
    images_[id] = std::move(image);
  }
}

void PairLoader::BeginRound() {
  intrinsics_ = ReadKnownIntrinsics(database_);
  reads_done_ = false;
}

void PairLoader::BeginDoneAgain() {
  intrinsics_ = ReadKnownIntrinsics(database_);
  reads_done_ = true;
  for (auto& [id, known] : intrinsics_) known.judgement.reset();
}

std::string PairLoader::Name(image_t id) const {
  const auto image = images_.find(id);
  return image == images_.end() ? "image " + std::to_string(id) : image->second.name;
}

PairImage PairLoader::LoadImage(image_t id) {
  PairImage loaded;
  const auto known = is_damaged_.find(id);
  if (known != is_damaged_.end() && known->second) {
    loaded.is_damaged = true;
    return loaded;
  }
  try {
    ReadImage(id, loaded);
  } catch (const IoError& error) {
    stage_.Warn(std::string(error.what()) + "; the pairs of " + Name(id) + " are left out");
    loaded.is_damaged = true;
  }
  is_damaged_[id] = loaded.is_damaged;
  return loaded;
}

void PairLoader::ReadImage(image_t id, PairImage& loaded) {
  const auto image = images_.find(id);
  if (image == images_.end())
    throw IoError(database_.path(), "has pairs, but no image " + std::to_string(id));
  const auto camera = cameras_.find(image->second.camera_id);
  if (camera == cameras_.end()) {
    for (const UnknownCamera& unknown : database_.ReadUnknownCameras()) {
      if (unknown.camera_id != image->second.camera_id) continue;
      throw IoError(database_.path(), "the camera of " + Name(id) + " is of the unknown model " +
                                          std::to_string(unknown.model_id));
    }
    throw IoError(database_.path(), "has no camera of " + Name(id));
  }
  loaded.camera = camera->second;
  auto keypoints = database_.ReadKeypoints(id);
  if (!keypoints) throw IoError(database_.path(), "has matches, but no keypoints of " + Name(id));
  loaded.keypoints = std::move(*keypoints);
  try {
    loaded.depth = database_.ReadDepthSamples(id).value_or(std::vector<DepthSample>());
    if (!loaded.depth.empty() && loaded.depth.size() != loaded.keypoints.size()) {
      throw IoError(database_.path(), "has " + std::to_string(loaded.keypoints.size()) +
                                          " keypoints of " + Name(id) + ", but " +
                                          std::to_string(loaded.depth.size()) + " depth samples");
    }
  } catch (const IoError& error) {
    if (!is_damaged_.contains(id))
      stage_.Warn(std::string(error.what()) + "; its depth is not used");
    loaded.depth.clear();
  }
  Hasher hasher;
  hasher.Add(HashCamera(loaded.camera)).Add(HashValues(loaded.keypoints));
  if (!loaded.depth.empty()) hasher.Add(*database_.ReadDepthHash(id));
  loaded.content_hash = hasher.Digest();
  const auto known = intrinsics_.find(camera->first);
  if (known == intrinsics_.end()) return;
  loaded.camera = known->second.camera;
  loaded.camera.has_prior_focal_length = known->second.IsFocalTrusted();
}

bool PairLoader::LoadPair(PairTask& task, const std::function<PairFeed::ImagePtr(image_t)>& image) {
  try {
    return ReadPair(task, image);
  } catch (const IoError& error) {
    const auto [id1, id2] = PairIdToImagePair(task.pair_id);
    stage_.Warn(std::string(error.what()) + "; the pair of " + Name(id1) + " and " + Name(id2) +
                " is left out");
    left_out_[task.pair_id] = error.reason();
    return false;
  }
}

bool PairLoader::ReadPair(PairTask& task, const std::function<PairFeed::ImagePtr(image_t)>& image) {
  const auto [id1, id2] = PairIdToImagePair(task.pair_id);
  task.matches = *database_.ReadMatches(task.pair_id);
  task.are_best_first = origins_.AreOurs(task.pair_id);
  Hasher hasher;
  hasher.Add(HashValues(task.matches));
  if (static_cast<int>(task.matches.size()) >= min_num_matches_) {
    task.image1 = image(id1);
    task.image2 = image(id2);
    if (task.image1->is_damaged || task.image2->is_damaged) return false;
    CheckMatches(task);
    hasher.Add(task.image1->content_hash).Add(task.image2->content_hash);
  }
  task.input_hash = hasher.Digest();
  const JobRecord* job = ledger_.Find(task.pair_id);
  if (job == nullptr) return !reads_done_;
  if (job->input_hash != task.input_hash) {
    ledger_.ThrowChanged("the features, depth, cameras or matches of " + Name(id1) + " and " +
                         Name(id2));
  }
  return reads_done_;
}

void PairLoader::CheckMatches(const PairTask& task) const {
  for (const FeatureMatch& match : task.matches) {
    if (match.point1 < task.image1->keypoints.size() &&
        match.point2 < task.image2->keypoints.size()) {
      continue;
    }
    const auto [id1, id2] = PairIdToImagePair(task.pair_id);
    throw IoError(database_.path(), "matches of " + Name(id1) + " and " + Name(id2) +
                                        " refer to keypoints that are not there");
  }
}

}  // namespace cairn
