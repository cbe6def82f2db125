#include "relative_pose_experiments/real_scene.h"

#include <optional>
#include <set>

#include "cairn/base/error.h"
#include "cairn/database/database.h"
#include "cairn/io/model.h"
#include "cairn/pipeline/stages.h"
#include "database/match_origins.h"

namespace cairn::experiments {
namespace {

std::string LastPart(const std::string& name) { return name.substr(name.find_last_of('/') + 1); }

// Poses of the reference by the database's image ids, and which pairs it connects.
class Reference {
 public:
  Reference(const std::string& path, const std::map<image_t, RealImage>& images) {
    // Points of 1DSfM's references cannot be read (io/bundler.h).
    const bool has_points = !path.ends_with(".out");
    const Reconstruction model = ReadModel(path, {.read_points = has_points});
    std::map<std::string, image_t> ids;
    for (const auto& [id, image] : images) {
      ids[LastPart(image.name)] = id;
    }
    for (const auto& [id, image] : images) ids[image.name] = id;
    std::map<image_t, image_t> database_id;
    for (const auto& [id, image] : model.images) {
      auto it = ids.find(image.image.name);
      if (it == ids.end()) it = ids.find(LastPart(image.image.name));
      if (it == ids.end()) continue;
      poses_[it->second] = image.cam_from_world;
      database_id[id] = it->second;
    }
    has_points_ = !model.points3D.empty();
    for (const auto& [id, point] : model.points3D) AddTrack(point.track, database_id);
  }

  std::optional<Rigid3d> RelativePose(image_t id1, image_t id2) const {
    const auto it1 = poses_.find(id1), it2 = poses_.find(id2);
    if (it1 == poses_.end() || it2 == poses_.end()) return std::nullopt;
    if (has_points_ && !connected_.contains(ImagePairToPairId(id1, id2))) return std::nullopt;
    const Rigid3d pose = it2->second * Inverse(it1->second);
    if (!(pose.translation.norm() > 0)) return std::nullopt;
    return pose;
  }

 private:
  void AddTrack(const Track& track, const std::map<image_t, image_t>& database_id) {
    for (size_t a = 0; a < track.size(); ++a) {
      for (size_t b = a + 1; b < track.size(); ++b) {
        const auto it1 = database_id.find(track[a].image_id);
        const auto it2 = database_id.find(track[b].image_id);
        if (it1 == database_id.end() || it2 == database_id.end()) continue;
        connected_.insert(ImagePairToPairId(it1->second, it2->second));
      }
    }
  }

  std::map<image_t, Rigid3d> poses_;
  bool has_points_ = false;
  std::set<image_pair_t> connected_;
};

std::map<image_t, RealImage> ReadRealImages(const Database& database) {
  std::map<camera_t, Camera> cameras;
  for (const Camera& camera : database.ReadCameras()) cameras[camera.camera_id] = camera;
  std::map<image_t, RealImage> images;
  for (const Image& image : database.ReadImages()) {
    auto keypoints = database.ReadKeypoints(image.image_id);
    if (!keypoints || !cameras.contains(image.camera_id)) continue;  // (of an unknown model)
    RealImage& out = images[image.image_id];
    out = {image.name, cameras.at(image.camera_id), std::move(*keypoints), {}};
    out.depth = database.ReadDepthSamples(image.image_id).value_or(std::vector<DepthSample>());
  }
  return images;
}

}  // namespace

RealScene LoadRealScene(const RealDataOptions& options, int min_num_matches,
                        ProgressMonitor& monitor) {
  if (options.database_path.empty()) throw ConfigError("database_path", "is needed");
  if (options.reference_path.empty()) throw ConfigError("reference_path", "is needed");
  const Database database(options.database_path, Database::Mode::kReadOnly);
  const MatchOrigins origins(database);
  RealScene scene;
  scene.images = ReadRealImages(database);
  const Reference reference(options.reference_path, scene.images);
  const std::vector<image_pair_t> pair_ids =
      options.pairs_path.empty() ? database.ReadMatchedPairIds()
                                 : ReadPairList(options.pairs_path, database.ReadImages(), monitor);
  for (const image_pair_t pair_id : pair_ids) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    if (!scene.images.contains(id1) || !scene.images.contains(id2)) continue;
    const auto pose = reference.RelativePose(id1, id2);
    if (!pose) continue;
    auto matches = database.ReadMatches(pair_id);
    if (!matches || static_cast<int>(matches->size()) < min_num_matches) continue;
    scene.pairs.push_back({pair_id, &scene.images.at(id1), &scene.images.at(id2),
                           std::move(*matches), origins.AreOurs(pair_id), *pose});
  }
  if (scene.pairs.empty()) {
    throw ConfigError("database_path", "no pair with matches that the reference connects");
  }
  return scene;
}

PairInput InputOf(const RealPair& pair, uint64_t seed) {
  return {.pair_id = pair.pair_id,
          .seed = seed,
          .camera1 = &pair.image1->camera,
          .camera2 = &pair.image2->camera,
          .keypoints1 = pair.image1->keypoints,
          .keypoints2 = pair.image2->keypoints,
          .depth1 = pair.image1->depth,
          .depth2 = pair.image2->depth,
          .matches = pair.matches,
          .are_best_first = pair.are_best_first};
}

}  // namespace cairn::experiments
