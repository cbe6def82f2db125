#include "pipeline/stages/recompute.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>
#include <set>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/depth/depth_map.h"
#include "database/match_origins.h"
#include "database/stage_names.h"
#include "pipeline/pairs/plan.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Features that were made elsewhere from photographs that are not here must not be lost.
void CheckPhotographs(const Database& database, BuildStage stage, const std::string& image_path) {
  if (image_path.empty()) {
    throw ConfigError("recompute",
                      std::string(NameOf(kBuildStages, stage)) + " needs --image_path");
  }
  const std::map<image_t, int> num_keypoints = database.ReadNumKeypoints();
  for (const Image& image : database.ReadImages()) {
    if (!num_keypoints.contains(image.image_id)) continue;
    if (!fs::exists(fs::path(image_path) / image.name)) {
      throw ConfigError("recompute", image.name + " has features, but is not in " + image_path +
                                         "; what was made from it would be lost");
    }
  }
}

// Images whose rows the stage wrote.
std::set<image_t> ImagesDoneBy(const std::string& stage, const Database& database) {
  std::set<image_t> images;
  for (const JobRecord& job : database.ReadJobs(stage)) {
    images.insert(static_cast<image_t>(job.item));
  }
  return images;
}

[[noreturn]] void ThrowLost(image_t id, const std::string& what) {
  throw ConfigError("recompute", "image " + std::to_string(id) + " has " + what);
}

// Pairs with matches, or with inliers alone; ascending.
std::vector<image_pair_t> PairsWithRows(const Database& database) {
  const std::vector<image_pair_t> matched = database.ReadMatchedPairIds();
  const std::vector<image_pair_t> verified = database.ReadTwoViewGeometryPairIds();
  std::vector<image_pair_t> pairs;
  std::ranges::set_union(matched, verified, std::back_inserter(pairs));
  return pairs;
}

void CheckDescriptors(const Database& database) {
  const std::map<image_t, int> num_descriptors = database.ReadNumDescriptors();
  const std::set<image_t> ours = ImagesDoneBy(kStageFeatures, database);
  for (const image_t id : ImagesOf(PairsWithRows(database))) {
    if (!num_descriptors.contains(id)) {
      ThrowLost(id, "matches, but no descriptors; its matches would be lost");
    }
    if (ours.contains(id)) continue;
    try {
      database.ReadDescriptors(id);
    } catch (const IoError& error) {
      ThrowLost(id, "matches that would be lost: its descriptors cannot be matched (" +
                        error.reason() + ")");
    }
  }
}

void CheckMatches(const Database& database) {
  const std::vector<image_pair_t> matched = database.ReadMatchedPairIds();
  for (const image_pair_t pair : database.ReadTwoViewGeometryPairIds()) {
    if (std::ranges::binary_search(matched, pair)) continue;
    const auto [id1, id2] = PairIdToImagePair(pair);
    ThrowLost(id1, "inliers with image " + std::to_string(id2) +
                       ", but no matches; the inliers would be lost");
  }
}

// Depth that was not sampled by us.
void CheckDepth(const Database& database, const std::string& image_path,
                const DepthSource& source) {
  const std::map<image_t, int> num_samples = database.ReadNumDepthSamples();
  const std::set<image_t> ours = ImagesDoneBy(kStageDepth, database);
  for (const Image& image : database.ReadImages()) {
    const image_t id = image.image_id;
    if (!num_samples.contains(id) || ours.contains(id)) continue;
    const bool has_source =
        source.depth_path.empty()
            ? fs::exists(fs::path(image_path) / image.name)
            : StaysInFolder(image.name) && FindDepthMap(source.depth_path, image.name).has_value();
    if (!has_source) {
      ThrowLost(id, "depth, but " + image.name + " has no source of it here; it would be lost");
    }
  }
}

// Images that we added are added anew, with other ids if others stay.
void DeleteOurImages(Database& database) {
  for (const JobRecord& job : database.ReadJobs(kStageCameras)) {
    database.DeleteImage(static_cast<image_t>(job.item));
  }
  database.ClearPhotos();
  database.ClearStage(kStageCameras);
}

// Our images keep their features; ImportPhotos gives them new cameras, and looks again at
// photographs that it refused.
void MarkCamerasAsPending(Database& database, const std::vector<JobRecord>& jobs) {
  for (const JobRecord& job : jobs) {
    database.WriteJob(kStageCameras, {job.item, job.input_hash, kPendingCamera});
  }
  for (const PhotoRecord& photo : database.ReadPhotos()) {
    if (!photo.error.empty()) database.WritePhoto({photo.name, 0, photo.error});
  }
}

// Which pairs another program matched was its choice: now they are chosen by us.
void ForgetGivenChoices(Database& database) {
  const MatchOrigins origins(database);
  for (const JobRecord& job : database.ReadJobs(kStagePairs)) {
    if (origins.IsGiven(static_cast<image_t>(job.item))) database.DeleteJob(kStagePairs, job.item);
  }
}

// Removes what the stage wrote, and those whose results follow from its own.
void ClearStageAndDependents(Database& database, BuildStage stage) {
  using enum BuildStage;
  for (const auto& [other, name] : kBuildStages) {
    const bool depends =
        other > stage && (other == kVerification || stage == kFeatures || stage == kPairs);
    if (other == stage || depends) database.ClearStage(std::string(name));
  }
}

}  // namespace

void PrepareRecompute(Database& database, BuildStage stage, const std::string& image_path,
                      const DepthSource& depth) {
  using enum BuildStage;
  if (stage != kNone && database.ReadStage(kStageDataset)) {
    throw ConfigError("recompute",
                      "an imported data set has nothing to compute again; use a new database");
  }
  if (stage == kChanged && image_path.empty()) {
    throw ConfigError("recompute", "changed needs --image_path, the folder of the photographs");
  }
  if (stage == kNone || stage == kChanged) return;  // ImportPhotos finds what changed
  const std::vector<JobRecord> our_images = database.ReadJobs(kStageCameras);
  if (stage == kFeatures || stage == kCameras) CheckPhotographs(database, stage, image_path);
  if (stage == kDepth) CheckDepth(database, image_path, depth);
  if (stage == kPairs || stage == kMatching) {
    CheckDescriptors(database);
  } else if (stage != kFeatures) {
    CheckMatches(database);
  }
  Database::Transaction transaction(database);
  if (stage == kMatching) ForgetGivenChoices(database);
  ClearStageAndDependents(database, stage);
  if (stage == kFeatures) DeleteOurImages(database);
  if (stage == kCameras) MarkCamerasAsPending(database, our_images);
  transaction.Commit();
}

}  // namespace cairn
