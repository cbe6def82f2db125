#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "mapper/image_nodes.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// What cameras have in common that may be one: model, size, and EXIF's focal length or none.
using CameraKind = std::tuple<CameraModel, int, int, double>;

CameraKind KindOf(const Camera& camera) {
  return {camera.model, camera.width, camera.height,
          camera.has_prior_focal_length ? camera.MeanFocal() : 0.0};
}

// The same, upright or on its side.
CameraKind Unturned(const CameraKind& kind) {
  const auto& [model, width, height, focal] = kind;
  return {model, std::min(width, height), std::max(width, height), focal};
}

// The kinds with several of these images that are, upright and on their side together, a quarter
// and more of them; none where such kinds are not most of them.
std::map<CameraKind, size_t> FrequentKinds(const SceneData& scene,
                                           const std::set<image_t>& images) {
  std::map<CameraKind, size_t> num_images, num_unturned;
  for (const image_t id : images) {
    const camera_t camera_id = scene.CameraIdOf(id);
    if (scene.constant_cameras.contains(camera_id)) continue;
    const CameraKind kind = KindOf(scene.cameras.at(camera_id));
    ++num_images[kind];
    ++num_unturned[Unturned(kind)];
  }
  size_t num_frequent = 0;
  std::erase_if(num_unturned, [&](const auto& entry) { return 4 * entry.second < images.size(); });
  for (const auto& [kind, num] : num_unturned) num_frequent += num;
  if (2 * num_frequent <= images.size()) return {};
  std::erase_if(num_images, [&](const auto& entry) {
    return entry.second < 2 || !num_unturned.contains(Unturned(entry.first));
  });
  return num_images;
}

// Images that pairs connect.
std::vector<std::set<image_t>> ConnectedImages(const SceneData& scene) {
  const ImageNodes images(scene.pixels);
  std::vector<GraphEdge> edges;
  for (const ViewEdge& edge : scene.edges) edges.push_back(images.EdgeOf(edge));
  return images.ConnectedBy(edges);
}

}  // namespace

std::vector<std::set<image_t>> LikelyOfOneCamera(const SceneData& scene) {
  struct Group {
    std::set<image_t> images;
    std::set<camera_t> cameras;
    size_t num_where_frequent = 0;
  };
  std::map<CameraKind, Group> groups;
  for (const std::set<image_t>& connected : ConnectedImages(scene)) {
    if (connected.size() < 2) continue;
    for (const image_t id : connected) {
      const camera_t camera_id = scene.CameraIdOf(id);
      if (scene.constant_cameras.contains(camera_id)) continue;
      Group& group = groups[KindOf(scene.cameras.at(camera_id))];
      group.images.insert(id);
      group.cameras.insert(camera_id);
    }
    for (const auto& [kind, num] : FrequentKinds(scene, connected)) {
      groups[kind].num_where_frequent += num;
    }
  }
  std::vector<std::set<image_t>> likely;
  for (auto& [kind, group] : groups) {
    const bool is_mostly_there = 2 * group.num_where_frequent > group.images.size();
    const bool has_a_camera_each = 2 * group.cameras.size() > group.images.size();
    if (is_mostly_there && has_a_camera_each) likely.push_back(std::move(group.images));
  }
  return likely;
}

bool AgreeWithOneCamera(std::span<const Reconstruction> models, const std::set<image_t>& images,
                        const SceneData& scene) {
  std::set<std::string> names;
  for (const image_t id : images) names.insert(scene.images.at(id).name);
  int num_images = 0;
  const bool agree = std::ranges::all_of(models, [&](const Reconstruction& model) {
    std::set<std::pair<CameraModel, std::vector<double>>> cameras;
    for (const auto& [id, image] : model.images) {
      if (!names.contains(image.image.name)) continue;
      const Camera& camera = model.cameras.at(image.image.camera_id);
      cameras.insert({camera.model, camera.params});
      ++num_images;
    }
    return cameras.size() <= 1;
  });
  return agree && num_images >= 2;
}

Camera MedianCamera(std::vector<Camera> cameras) {
  const auto median = cameras.begin() + cameras.size() / 2;
  std::ranges::nth_element(cameras, median, {}, [](const Camera& camera) {
    return std::pair(camera.MeanFocal(), camera.camera_id);
  });
  return *median;
}

void ShareCamera(const std::set<image_t>& images, Camera camera, const RunContext& run,
                 SceneData& scene) {
  std::set<camera_t> ids;
  for (const image_t id : images) ids.insert(scene.CameraIdOf(id));
  camera.camera_id = *ids.rbegin();  // the last, so that no new camera gets the id of another
  bool are_alike = true;
  for (const camera_t id : ids) {
    are_alike &= scene.cameras.at(id).params == camera.params;
    scene.cameras.erase(id);
    scene.focals_by_pairs.erase(id);
  }
  scene.cameras[camera.camera_id] = camera;
  for (auto& [id, image] : scene.images) {
    if (!ids.contains(image.camera_id)) continue;
    scene.stored_cameras[id] = std::exchange(image.camera_id, camera.camera_id);
  }
  if (are_alike) return;
  ImproveRelativePoses(ReadGeometriesOf({camera.camera_id}, scene), run, scene);
}

bool PairsConfirmFocals(const SceneData& scene, std::span<const Reconstruction> models) {
  struct Found {
    Eigen::Vector2d focals;  // logarithms: by pairs, by a model
    double weight;
  };
  std::vector<Found> cameras;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double total_weight = 0;
  for (const Reconstruction& model : models) {
    for (const auto& [id, camera] : model.cameras) {
      const auto by_pairs = scene.focals_by_pairs.find(id);
      if (by_pairs == scene.focals_by_pairs.end() || by_pairs->second.sigma <= 0) continue;
      const CalibratedFocal& focal = by_pairs->second;
      const double weight = 1 / (focal.sigma * focal.sigma);
      cameras.push_back({{std::log(focal.focal_px), std::log(camera.MeanFocal())}, weight});
      mean += weight * cameras.back().focals;
      total_weight += weight;
    }
  }
  mean /= total_weight;
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const auto& [focals, weight] : cameras) {
    scatter += weight * (focals - mean) * (focals - mean).transpose();
  }
  // Lin's concordance correlation coefficient (Biometrics 1989), but for the common factor.
  return 2 * scatter(0, 1) > 0.5 * scatter.trace();
}

void UnshareCamera(const std::map<image_t, camera_t>& stored, Reconstruction& model) {
  const std::map<camera_t, Camera> shared = std::exchange(model.cameras, {});
  for (auto& [id, image] : model.images) {
    camera_t& camera_id = image.image.camera_id;
    Camera camera = shared.at(camera_id);
    if (const auto own = stored.find(id); own != stored.end()) camera_id = own->second;
    camera.camera_id = camera_id;
    model.cameras[camera_id] = std::move(camera);
  }
}

}  // namespace cairn
