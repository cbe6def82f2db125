#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/math/median.h"
#include "report_page/page_parts.h"

namespace cairn {
namespace {

// JSON has no infinity; null stands for "not determined".
Json FiniteOrNull(double value) { return std::isfinite(value) ? Json(value) : Json(); }

// Distance of the farthest of the middle half of the cameras from their median position.
double CameraSpread(const Reconstruction& model) {
  std::vector<double> coordinates[3];
  for (const auto& [id, image] : model.images) {
    const Eigen::Vector3d center = image.cam_from_world.Center();
    for (int k = 0; k < 3; ++k) coordinates[k].push_back(center[k]);
  }
  Eigen::Vector3d middle;
  for (int k = 0; k < 3; ++k) middle[k] = UpperMedian(coordinates[k]);
  std::vector<double> distances;
  for (const auto& [id, image] : model.images) {
    distances.push_back((image.cam_from_world.Center() - middle).norm());
  }
  return UpperMedian(distances);
}

// Every so many-th point, so that all models together keep within the limit.
void AddPoints(const Reconstruction& model, int64_t step, PageBlocks& blocks, Json& json) {
  std::vector<float> xyz;
  std::vector<uint8_t> rgb;
  int64_t index = 0;
  for (const auto& [id, point] : model.points3D) {
    if (index++ % step != 0) continue;
    for (int k = 0; k < 3; ++k) xyz.push_back(static_cast<float>(point.xyz[k]));
    rgb.insert(rgb.end(), point.color.begin(), point.color.end());
  }
  json["shown"] = xyz.size() / 3;
  json["xyz"] = blocks.Add(xyz);
  json["rgb"] = blocks.Add(rgb);
}

// How sure a model is of its photos' poses, and how much of their matches it explains.
void AddConfidence(const PageScene& scene, int model, double radius, Json& json) {
  Support inside;  // of the pairs between its images
  std::vector<double> rotations_deg, positions;
  int num_pairs = 0, num_contradicted = 0;
  for (const PagePair& pair : scene.pairs) {
    if (scene.images[pair.image1].model != model || scene.images[pair.image2].model != model ||
        pair.support.num_matches == 0) {
      continue;
    }
    ++num_pairs;
    num_contradicted += pair.support.IsContradicted();
    inside = inside + pair.support;
  }
  for (const PageImage& image : scene.images) {
    if (image.model != model) continue;
    rotations_deg.push_back(image.confidence.rotation_sigma_deg);
    positions.push_back(image.confidence.position_sigma);
  }
  json["explained"] = inside.num_matches > 0 ? Json(inside.Share()) : Json();
  json["pairs"] = num_pairs;
  json["contradicted_pairs"] = num_contradicted;
  const bool known = !rotations_deg.empty() && radius > 0;
  json["rotation_sigma_deg"] = known ? FiniteOrNull(UpperMedian(rotations_deg)) : Json();
  json["position_sigma"] = known ? FiniteOrNull(UpperMedian(positions) / radius) : Json();
}

const char* OriginOf(const PageCamera& camera) {
  if (camera.known.is_given) return "given";
  if (camera.known.IsRejected()) return "came with the photos, contradicted by the pairs";
  if (camera.known.camera.has_prior_focal_length) return "came with the photos (EXIF)";
  if (camera.known.lens && camera.known.lens->focal_px > 0) return "learned from the pairs";
  return "guessed";
}

Json MapJson(const ResidualMap& map, PageBlocks& blocks) {
  return {{"columns", map.columns},   {"rows", map.rows},         {"count", blocks.Add(map.count)},
          {"dx", blocks.Add(map.dx)}, {"dy", blocks.Add(map.dy)}, {"rms", blocks.Add(map.rms)}};
}

// The cameras with the most observations get a map.
int64_t ObservationsForMap(const PageScene& scene) {
  constexpr size_t kMaxMaps = 24;
  std::vector<int64_t> counts;
  for (const auto& [id, camera] : scene.cameras) counts.push_back(camera.num_observations);
  std::sort(counts.rbegin(), counts.rend());
  return std::max<int64_t>(1, counts.size() > kMaxMaps ? counts[kMaxMaps] + 1 : 1);
}

}  // namespace

Json ModelsJson(const PageScene& scene, PageBlocks& blocks) {
  int64_t num_points = 0;
  for (const Reconstruction& model : scene.input.models) num_points += model.points3D.size();
  const int64_t limit = std::max<int64_t>(1, scene.input.limits.points);
  const int64_t step = std::max<int64_t>(1, (num_points + limit - 1) / limit);
  Json models = Json::array();
  for (size_t k = 0; k < scene.input.models.size(); ++k) {
    const Reconstruction& model = scene.input.models[k];
    Json json;
    json["name"] = scene.input.model_names[k];
    json["images"] = model.images.size();
    json["points"] = model.points3D.size();
    json["track_length"] = model.MeanTrackLength();
    json["error_px"] = model.MeanReprojectionErrorPx(scene.run.num_threads);
    AddConfidence(scene, static_cast<int>(k), CameraSpread(model), json);
    AddPoints(model, step, blocks, json);
    models.push_back(std::move(json));
  }
  return models;
}

Json ImagesJson(const PageScene& scene, PageBlocks& blocks) {
  std::map<camera_t, int> camera_index;
  for (const auto& [id, camera] : scene.cameras) {
    camera_index.try_emplace(id, static_cast<int>(camera_index.size()));
  }
  constexpr int kNumPose = 12;  // rotation cam_from_world, row by row; center
  const float unknown = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> poses(kNumPose * scene.images.size(), unknown);
  Json list = Json::array();
  for (size_t i = 0; i < scene.images.size(); ++i) {
    const PageImage& image = scene.images[i];
    Json json = {{"name", image.image.name},
                 {"model", image.model},
                 {"camera", camera_index.at(image.image.camera_id)},
                 {"pairs", image.num_pairs}};
    if (image.model >= 0) {
      json["points"] = image.num_points;
      json["error_px"] = image.error_px;
      json["rotation_sigma_deg"] = FiniteOrNull(image.confidence.rotation_sigma_deg);
      if (image.support.num_matches > 0) json["explained"] = image.support.Share();
      const Rigid3d& pose =
          scene.input.models[image.model].images.at(image.image.image_id).cam_from_world;
      Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> rotation(&poses[kNumPose * i]);
      rotation = pose.RotationMatrix().cast<float>();
      Eigen::Map<Eigen::Vector3f> center(&poses[kNumPose * i + 9]);
      center = pose.Center().cast<float>();
    } else {
      json["reason"] = WhyLeftOut(image, scene.has_features).what;
    }
    list.push_back(std::move(json));
  }
  std::vector<WeightedEdge> edges;
  for (const PagePair& pair : scene.pairs) {
    if (pair.InUse()) edges.push_back({pair.image1, pair.image2, std::log(2.0 + pair.num_inliers)});
  }
  return {{"list", std::move(list)},
          {"poses", blocks.Add(poses)},
          {"order", SpectralOrder(static_cast<int>(scene.images.size()), edges)}};
}

Json CamerasJson(const PageScene& scene, PageBlocks& blocks) {
  const int64_t min_observations = ObservationsForMap(scene);
  Json cameras = Json::array();
  for (const auto& [id, camera] : scene.cameras) {
    const Camera& shown = camera.refined ? *camera.refined : camera.known.camera;
    Json json = {{"id", id},
                 {"model", CameraModelName(shown.model)},
                 {"width", shown.width},
                 {"height", shown.height},
                 {"params", shown.params},
                 {"images", camera.num_images},
                 {"origin", OriginOf(camera)},
                 {"doubt", DoubtAboutCamera(camera)}};
    if (!shown.params.empty()) {
      json["focal_px"] = shown.MeanFocal();
      json["focal_before_px"] =
          camera.known.camera.params.empty() ? Json() : Json(camera.known.camera.MeanFocal());
    }
    if (camera.map && camera.num_observations >= min_observations) {
      json["map"] = MapJson(*camera.map, blocks);
    }
    cameras.push_back(std::move(json));
  }
  return cameras;
}

}  // namespace cairn
