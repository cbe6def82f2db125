#include "cairn/mapper/view_edges.h"

#include <Eigen/LU>
#include <map>

#include "cairn/base/error.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "database/stage_names.h"
#include "intrinsics/known_intrinsics.h"

namespace cairn {
namespace {

// What is needed to find a pose from E or F; keypoints are kept, since pairs come by first image.
class PoseFinder {
 public:
  explicit PoseFinder(const Database& database) : database_(database) {
    for (const auto& [id, known] : ReadKnownIntrinsics(database)) cameras_[id] = known.camera;
    for (const Image& image : database.ReadImages()) camera_ids_[image.image_id] = image.camera_id;
  }

  std::optional<Rigid3d> Find(image_t id1, image_t id2, const TwoViewGeometry& geometry) {
    const Camera* camera1 = FindCamera(id1);
    const Camera* camera2 = FindCamera(id2);
    if (!camera1 || !camera2) return std::nullopt;
    const std::optional<Eigen::Matrix3d> E = EssentialOf(geometry, *camera1, *camera2);
    if (!E) return std::nullopt;
    const std::vector<Keypoint>& keypoints1 = Keypoints(id1);
    const std::vector<Keypoint>& keypoints2 = Keypoints(id2);
    std::vector<Eigen::Vector3d> rays1, rays2;
    for (const FeatureMatch& match : geometry.inlier_matches) {
      if (match.point1 >= keypoints1.size() || match.point2 >= keypoints2.size()) continue;
      const auto ray1 = camera1->RayFromImg(keypoints1[match.point1].Position());
      const auto ray2 = camera2->RayFromImg(keypoints2[match.point2].Position());
      if (!ray1 || !ray2) continue;
      rays1.push_back(*ray1);
      rays2.push_back(*ray2);
    }
    if (rays1.empty()) return std::nullopt;
    const CheiralityResult best = SelectPoseByCheirality(NearestEssential(*E), rays1, rays2);
    if (best.num_in_front == 0) return std::nullopt;
    return best.cam2_from_cam1;
  }

 private:
  const Camera* FindCamera(image_t image_id) const {
    const auto camera_id = camera_ids_.find(image_id);
    if (camera_id == camera_ids_.end()) return nullptr;
    const auto camera = cameras_.find(camera_id->second);
    return camera == cameras_.end() ? nullptr : &camera->second;
  }

  const std::vector<Keypoint>& Keypoints(image_t image_id) {
    auto [it, is_new] = keypoints_.try_emplace(image_id);
    if (!is_new) return it->second;
    try {
      it->second = database_.ReadKeypoints(image_id).value_or(std::vector<Keypoint>());
    } catch (const IoError&) {  // who reads the image's own rows says so
    }
    return it->second;
  }

  const Database& database_;
  std::map<camera_t, Camera> cameras_;
  std::map<image_t, camera_t> camera_ids_;
  std::map<image_t, std::vector<Keypoint>> keypoints_;
};

bool MayHaveTranslation(TwoViewConfig config) {
  return config == TwoViewConfig::kCalibrated || config == TwoViewConfig::kUncalibrated ||
         config == TwoViewConfig::kPlanar;
}

ViewEdge EdgeFromGeometry(image_pair_t pair_id, const TwoViewGeometry& geometry,
                          PoseFinder& poses) {
  ViewEdge edge;
  std::tie(edge.image_id1, edge.image_id2) = PairIdToImagePair(pair_id);
  edge.num_inliers = static_cast<int>(geometry.inlier_matches.size());
  std::optional<Rigid3d> pose = geometry.cam2_from_cam1;
  const bool may_translate = MayHaveTranslation(geometry.config);
  if (!pose && may_translate) pose = poses.Find(edge.image_id1, edge.image_id2, geometry);
  if (pose && may_translate && pose->translation.norm() > 0) {
    pose->translation.normalize();
    edge.cam2_from_cam1 = *pose;
  } else if (pose && geometry.config == TwoViewConfig::kPanoramic && HasTurned(pose->rotation)) {
    edge.cam2_from_cam1 = Rigid3d(pose->rotation, Eigen::Vector3d::Zero());
  } else {
    edge.removal = EdgeRemoval::kNoPose;
  }
  return edge;
}

// Throws IoError where the row cannot be used.
TwoViewGeometry ReadGeometry(const Database& database, image_pair_t pair_id,
                             const std::map<image_t, int>& num_keypoints) {
  TwoViewGeometry geometry = *database.ReadTwoViewGeometry(pair_id);
  const auto [id1, id2] = PairIdToImagePair(pair_id);
  const auto num_of = [&](image_t id) {
    const auto it = num_keypoints.find(id);
    return it == num_keypoints.end() ? 0 : static_cast<int64_t>(it->second);
  };
  const int64_t num1 = num_of(id1), num2 = num_of(id2);
  for (const FeatureMatch& match : geometry.inlier_matches) {
    if (match.point1 < num1 && match.point2 < num2) continue;
    throw IoError(database.path(), "the verified matches of images " + std::to_string(id1) +
                                       " and " + std::to_string(id2) +
                                       " refer to keypoints that are not there");
  }
  return geometry;
}

}  // namespace

std::vector<ViewEdge> ReadViewEdges(
    const Database& database, const std::function<void(const std::string&)>& warn,
    const std::function<void(const ViewEdge&, TwoViewGeometry&&)>& keep) {
  const std::map<image_t, int> num_keypoints = database.ReadNumKeypoints();
  std::map<image_pair_t, PairMetrics> winners;
  for (PairMetrics& metrics : database.ReadPairMetrics()) {
    if (metrics.is_winner) winners[metrics.pair_id] = std::move(metrics);
  }
  PoseFinder poses(database);
  std::vector<ViewEdge> edges;
  for (const auto& [pair_id, num_inliers] : database.ReadNumInliers()) {
    const auto winner = winners.find(pair_id);
    if (num_inliers == 0 && winner == winners.end()) continue;
    TwoViewGeometry geometry;
    try {
      geometry = ReadGeometry(database, pair_id, num_keypoints);
    } catch (const IoError& error) {
      warn(std::string(error.what()) + "; the pair is left out");
      continue;
    }
    ViewEdge edge = EdgeFromGeometry(pair_id, geometry, poses);
    if (winner != winners.end()) {
      edge.residual_px = winner->second.residual_px;
      edge.triangulation_angle_deg = winner->second.triangulation_angle_deg;
      edge.verifier = winner->second.step;
    }
    edge.source = winner == winners.end()                        ? EdgeSource::kOtherProgram
                  : winner->second.verifier == kImportedVerifier ? EdgeSource::kDataset
                                                                 : EdgeSource::kVerified;
    if (keep) keep(edge, std::move(geometry));
    edges.push_back(std::move(edge));
  }
  return edges;
}

bool HasTurned(const Eigen::Quaterniond& cam2_from_cam1) {
  constexpr double kMinTurnDeg = 1.0;  // some 20 pixels, far beyond the noise of keypoints
  return RadToDeg(AngleBetween(cam2_from_cam1, Eigen::Quaterniond::Identity())) > kMinTurnDeg;
}

}  // namespace cairn
