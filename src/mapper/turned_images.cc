#include <algorithm>
#include <utility>

#include "mapper/stages.h"

namespace cairn {
namespace {

// By a quarter: clockwise where the picture lies on its side, as phones turn theirs, and back where
// it is upright.
struct QuarterTurn {
  Eigen::Matrix3d of_rays = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d of_pixels = Eigen::Matrix3d::Identity();  // homogeneous

  QuarterTurn() = default;  // none
  explicit QuarterTurn(const Camera& camera) {
    const bool is_on_its_side = camera.width > camera.height;
    const double sine = is_on_its_side ? 1 : -1;
    of_rays << 0, -sine, 0, sine, 0, 0, 0, 0, 1;
    of_pixels = of_rays;
    if (is_on_its_side) {
      of_pixels(0, 2) = camera.height;
    } else {
      of_pixels(1, 2) = camera.width;
    }
  }

  Rigid3d Pose() const { return {of_rays, Eigen::Vector3d::Zero()}; }
  void Apply(Eigen::Vector2d& pixel) const {
    pixel = (of_pixels * pixel.homogeneous()).head<2>().eval();
  }
};
using Turns = std::map<image_t, QuarterTurn>;

// Whether the lens distorts by the radius alone.
bool IsRound(CameraModel model) {
  switch (model) {
    case CameraModel::kOpenCV:
    case CameraModel::kFullOpenCV:
    case CameraModel::kThinPrismFisheye:
    case CameraModel::kRadTanThinPrismFisheye:
    case CameraModel::kEquirectangular:
      return false;
    default:
      return true;
  }
}

bool AreAlikeOnceTurned(const Camera& a, const Camera& b) {
  return IsRound(a.model) && a.model == b.model && a.width != a.height && a.width == b.height &&
         a.height == b.width && a.has_prior_focal_length == b.has_prior_focal_length &&
         (!a.has_prior_focal_length || a.MeanFocal() == b.MeanFocal());
}

void TurnCamera(Camera& camera) {
  Eigen::Vector2d center = camera.PrincipalPoint();
  QuarterTurn(camera).Apply(center);
  const std::vector<int> focal = camera.FocalIndices(), middle = camera.PrincipalPointIndices();
  std::swap(camera.params[focal.front()], camera.params[focal.back()]);
  camera.params[middle[0]] = center.x();
  camera.params[middle[1]] = center.y();
  std::swap(camera.width, camera.height);
}

// The turns of a pair's images.
struct PairTurn {
  QuarterTurn turn1, turn2;

  PairTurn(const Turns& turns, image_pair_t pair_id) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    if (const auto turn = turns.find(id1); turn != turns.end()) turn1 = turn->second;
    if (const auto turn = turns.find(id2); turn != turns.end()) turn2 = turn->second;
  }

  void Apply(Rigid3d& cam2_from_cam1) const {
    cam2_from_cam1 = turn2.Pose() * cam2_from_cam1 * Inverse(turn1.Pose());
  }
  void Apply(TwoViewGeometry& geometry) const {
    const Eigen::Matrix3d inverse1 = turn1.of_pixels.inverse();
    const Eigen::Matrix3d inverse2 = turn2.of_pixels.inverse();
    if (geometry.cam2_from_cam1) Apply(*geometry.cam2_from_cam1);
    if (geometry.E) geometry.E = turn2.of_rays * *geometry.E * turn1.of_rays.transpose();
    if (geometry.F) geometry.F = inverse2.transpose() * *geometry.F * inverse1;
    if (geometry.H) geometry.H = turn2.of_pixels * *geometry.H * inverse1;
  }
};

void TurnEdges(const Turns& turns, std::vector<ViewEdge>& edges) {
  for (ViewEdge& edge : edges) PairTurn(turns, edge.PairId()).Apply(edge.cam2_from_cam1);
}

void TurnGeometries(const Turns& turns, SceneData& scene) {
  for (auto& [pair_id, geometry] : scene.foreign) PairTurn(turns, pair_id).Apply(geometry);
  scene.stored_geometry = [turns, stored = std::move(scene.stored_geometry)](image_pair_t pair_id) {
    TwoViewGeometry geometry = stored(pair_id);
    PairTurn(turns, pair_id).Apply(geometry);
    return geometry;
  };
}

void TurnControlPoints(const Turns& turns, SceneData& scene) {
  if (!scene.places || scene.places->control_points.empty()) return;
  KnownPositions places = *scene.places;
  for (const auto& [id, turn] : turns) {
    for (ControlPoint& point : places.control_points) {
      const auto pixel = point.pixels.find(scene.images.at(id).name);
      if (pixel != point.pixels.end()) turn.Apply(pixel->second);
    }
  }
  scene.places = std::make_shared<const KnownPositions>(std::move(places));
}

// Turns the pictures of these cameras. Returns their images.
std::set<image_t> TurnPictures(const std::set<camera_t>& cameras, SceneData& scene) {
  std::set<image_t> images;
  Turns turns;
  for (auto& [id, pixels] : scene.pixels) {
    if (!cameras.contains(scene.CameraIdOf(id))) continue;
    images.insert(id);
    turns[id] = QuarterTurn(scene.CameraOf(id));
    for (Eigen::Vector2d& pixel : pixels) turns[id].Apply(pixel);
  }
  for (const camera_t id : cameras) TurnCamera(scene.cameras.at(id));
  TurnEdges(turns, scene.edges);
  TurnGeometries(turns, scene);
  TurnControlPoints(turns, scene);
  return images;
}

}  // namespace

std::set<image_t> TurnAlike(std::vector<std::set<image_t>>& groups, SceneData& scene) {
  std::set<image_t> turned;
  const auto camera_of = [&](const std::set<image_t>& group) {
    return scene.CameraOf(*group.begin());
  };
  for (size_t i = 0; i < groups.size(); ++i) {
    const auto is_alike = [&, camera = camera_of(groups[i])](const std::set<image_t>& other) {
      return AreAlikeOnceTurned(camera, camera_of(other));
    };
    const auto other = std::find_if(groups.begin() + i, groups.end(), is_alike);
    if (other == groups.end()) continue;
    std::set<camera_t> cameras;
    for (const image_t id : other->size() < groups[i].size() ? *other : groups[i]) {
      cameras.insert(scene.CameraIdOf(id));
    }
    turned.merge(TurnPictures(cameras, scene));
    groups[i].merge(*other);
    groups.erase(other);
  }
  return turned;
}

void TurnBack(const std::set<image_t>& turned, const SceneData& scene, PartResult& result) {
  Turns turns;
  for (const image_t id : turned) turns[id] = QuarterTurn(scene.CameraOf(id));
  TurnEdges(turns, result.graph.edges);
  for (Reconstruction& model : result.models) {
    std::set<camera_t> cameras;
    for (auto& [id, image] : model.images) {
      const auto turn = turns.find(id);
      if (turn == turns.end()) continue;
      cameras.insert(image.image.camera_id);
      image.cam_from_world = turn->second.Pose() * image.cam_from_world;
      for (Eigen::Vector2d& pixel : image.points2D) turn->second.Apply(pixel);
    }
    for (const camera_t id : cameras) TurnCamera(model.cameras.at(id));
  }
}

}  // namespace cairn
