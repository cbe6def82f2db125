#include <algorithm>
#include <cmath>

#include "cairn/base/error.h"
#include "cairn/pipeline/view_edges.h"
#include "pipeline/learned_cameras.h"
#include "pipeline/reconstruct_stages.h"
#include "pipeline/stage_names.h"

namespace cairn {
namespace {

// The smaller singular value of the frame.
float ShorterAxis(const Keypoint& k) {
  const double squares = k.a11 * k.a11 + k.a12 * k.a12 + k.a21 * k.a21 + k.a22 * k.a22;
  const double det = std::abs(k.a11 * k.a22 - k.a12 * k.a21);
  const double sum = std::sqrt(squares + 2 * det);  // of the singular values
  const double difference = std::sqrt(std::max(0.0, squares - 2 * det));
  return static_cast<float>(0.5 * (sum - difference));
}

void ReadImagesAndKeypoints(const Database& database, SceneData& scene, Stage& stage,
                            std::map<image_t, std::vector<point2D_t>>& first_keypoint) {
  const std::map<camera_t, CameraFocal> focals = database.ReadCameraFocals();
  for (Camera& camera : ReadLearnedCameras(database)) {
    const auto focal = focals.find(camera.camera_id);
    if (focal != focals.end() && focal->second.is_refuted) camera.has_prior_focal_length = false;
    scene.cameras[camera.camera_id] = std::move(camera);
  }
  std::map<camera_t, int64_t> unknown_models;
  for (const UnknownCamera& camera : database.ReadUnknownCameras()) {
    unknown_models[camera.camera_id] = camera.model_id;
  }
  for (const Image& image : database.ReadImages()) {
    scene.images[image.image_id] = image;
    const auto skip = [&](const std::string& reason) {
      scene.bad_images.insert(image.image_id);
      stage.Warn(image.name + ": left out: " + reason);
    };
    const auto unknown = unknown_models.find(image.camera_id);
    if (unknown != unknown_models.end()) {
      skip("camera " + std::to_string(image.camera_id) + " is of the unknown model " +
           std::to_string(unknown->second));
      continue;
    }
    const auto camera = scene.cameras.find(image.camera_id);
    if (camera == scene.cameras.end()) {
      skip("the database has no camera " + std::to_string(image.camera_id));
      continue;
    }
    if (const std::string reason = camera->second.Validate(); !reason.empty()) {
      skip("camera " + std::to_string(image.camera_id) + ": " + reason);
      continue;
    }
    std::vector<Keypoint> keypoints;
    try {
      keypoints = database.ReadKeypoints(image.image_id).value_or(std::vector<Keypoint>());
    } catch (const IoError& error) {
      skip(error.reason());
      continue;
    }
    std::vector<Eigen::Vector2d>& pixels = scene.pixels[image.image_id];
    pixels.reserve(keypoints.size());
    std::vector<float>& scales = scene.scales[image.image_id];
    scales.reserve(keypoints.size());
    for (const Keypoint& keypoint : keypoints) {
      pixels.push_back(keypoint.Position());
      scales.push_back(ShorterAxis(keypoint));
    }
    first_keypoint[image.image_id] = FirstKeypointsAtPosition(keypoints);
  }
}

// Inlier matches with every keypoint replaced by the first one at its position.
FeatureMatches MergeMatches(FeatureMatches matches, const std::vector<point2D_t>& first1,
                            const std::vector<point2D_t>& first2) {
  std::erase_if(matches, [&](const FeatureMatch& match) {
    return match.point1 >= first1.size() || match.point2 >= first2.size();
  });
  for (FeatureMatch& match : matches) {
    match = {first1[match.point1], first2[match.point2]};
  }
  const auto less = [](const FeatureMatch& a, const FeatureMatch& b) {
    return std::pair(a.point1, a.point2) < std::pair(b.point1, b.point2);
  };
  std::sort(matches.begin(), matches.end(), less);
  matches.erase(std::unique(matches.begin(), matches.end()), matches.end());
  return matches;
}

}  // namespace

std::set<camera_t> CamerasToHold(const std::map<camera_t, Camera>& cameras) {
  std::set<camera_t> held;
  for (const auto& [id, camera] : cameras) {
    const Eigen::Vector2d center(0.5 * camera.width, 0.5 * camera.height);
    // COLMAP rounds the center of an odd size down in some versions.
    const bool off_center = (camera.PrincipalPoint() - center).cwiseAbs().maxCoeff() > 0.5 + 1e-9;
    const bool two_focals = camera.FocalX() != camera.FocalY();
    bool distorted = false;
    const Camera plain =
        Camera::FromFocal(id, camera.model, camera.MeanFocal(), camera.width, camera.height);
    for (const int k : camera.DistortionIndices()) distorted |= camera.params[k] != plain.params[k];
    if (off_center || two_focals || distorted) held.insert(id);
  }
  return held;
}

namespace {

// Edges with their merged inlier matches; geometries of those that another program verified.
void ReadEdges(const Database& database,
               const std::map<image_t, std::vector<point2D_t>>& first_keypoint, SceneData& scene,
               std::map<image_pair_t, TwoViewGeometry>& foreign) {
  for (ViewEdge& edge : ReadViewEdges(database)) {
    if (scene.pixels.count(edge.image_id1) == 0 || scene.pixels.count(edge.image_id2) == 0) {
      continue;
    }
    TwoViewGeometry geometry = database.ReadTwoViewGeometry(edge.PairId()).value();
    // What lies over the photographs, or stands still before the camera, says nothing of the scene.
    const bool is_still = geometry.config == TwoViewConfig::kPanoramic && geometry.cam2_from_cam1 &&
                          !HasTurned(geometry.cam2_from_cam1->rotation);
    if (is_still || geometry.config == TwoViewConfig::kWatermark) geometry.inlier_matches.clear();
    scene.matches[edge.PairId()] =
        MergeMatches(std::move(geometry.inlier_matches), first_keypoint.at(edge.image_id1),
                     first_keypoint.at(edge.image_id2));
    scene.poses_imported |= edge.verifier == kImportedVerifier;
    if (edge.verifier.empty()) foreign[edge.PairId()] = std::move(geometry);
    scene.edges.push_back(std::move(edge));
  }
}

// Cameras that look measured are held, unless verification has refuted their focal lengths or
// learned what they are; those
// that the user gave or wants held are, with a warning.
void ChooseHeldCameras(const Database& database, const ReconstructSettings& settings, Stage& stage,
                       SceneData& scene) {
  const std::map<camera_t, CameraFocal> focals = database.ReadCameraFocals();
  for (const auto& [id, camera] : scene.cameras) scene.held_cameras.insert(id);
  if (settings.refine_intrinsics) {
    if (*settings.refine_intrinsics) scene.held_cameras.clear();
  } else if (!CamerasWereGiven(database)) {
    scene.held_cameras = CamerasToHold(scene.cameras);
    for (const auto& [id, focal] : focals) {
      if (focal.is_refuted) scene.held_cameras.erase(id);
    }
    for (const auto& [id, lens] : database.ReadCameraLenses()) {
      if (!lens.IsEmpty()) scene.held_cameras.erase(id);
    }
  }
  for (const camera_t id : scene.held_cameras) {
    const auto focal = focals.find(id);
    if (focal == focals.end() || !focal->second.is_refuted) continue;
    stage.Warn("camera " + std::to_string(id) + " is held, but " +
               std::to_string(focal->second.num_refuting) + " of " +
               std::to_string(focal->second.num_pairs) +
               " pairs say that its focal length is wrong: try --refine_intrinsics 1");
  }
}

}  // namespace

SceneData ReadSceneData(const Database& database, const ReconstructSettings& settings,
                        ProgressMonitor& monitor, RunReport& report) {
  SceneData scene;
  std::map<image_pair_t, TwoViewGeometry> foreign;
  {
    Stage stage(report, monitor, "read");
    std::map<image_t, std::vector<point2D_t>> first_keypoint;
    ReadImagesAndKeypoints(database, scene, stage, first_keypoint);
    ReadEdges(database, first_keypoint, scene, foreign);
    scene.raw_matches = [&database, first_keypoint](const ViewEdge& edge) {
      return MergeMatches(database.ReadMatches(edge.PairId()).value_or(FeatureMatches()),
                          first_keypoint.at(edge.image_id1), first_keypoint.at(edge.image_id2));
    };
    size_t num_matches = 0;
    for (const auto& [pair_id, matches] : scene.matches) num_matches += matches.size();
    scene.poses_alone = scene.poses_imported && num_matches == 0;
    ChooseHeldCameras(database, settings, stage, scene);
    stage.Add("cameras", static_cast<double>(scene.cameras.size()));
    stage.Add("cameras_held", static_cast<double>(scene.held_cameras.size()));
    stage.Add("images", static_cast<double>(scene.pixels.size()));
    stage.Add("pairs", static_cast<double>(scene.edges.size()));
    stage.Add("matches", static_cast<double>(num_matches));
    stage.Note("intrinsics of " + std::to_string(scene.held_cameras.size()) + " of " +
               std::to_string(scene.cameras.size()) + " cameras are held (--refine_intrinsics)");
    if (scene.pixels.empty()) {
      stage.Fail("the database has no image with keypoints",
                 "run build_view_graph with --image_path first");
    } else if (scene.edges.empty()) {
      stage.Fail("the database has " + std::to_string(scene.pixels.size()) +
                     " images and no verified pair",
                 "run build_view_graph up to verification, or try a larger --matching.max_ratio or "
                 "--features.max_num_features");
    }
    if (scene.poses_alone) {
      stage.Note(
          "the pairs have poses and no matches: only poses are averaged, there are no points");
    }
  }
  if (!report.Succeeded() || scene.poses_alone) return scene;
  if (settings.focal_calibration.enabled && scene.held_cameras.size() < scene.cameras.size()) {
    Stage stage(report, monitor, "focal_calibration");
    const GeometryReader read = [&](image_pair_t pair_id) {
      return database.ReadTwoViewGeometry(pair_id).value();
    };
    CalibrateSceneFocals(read, foreign, settings, stage, scene);
  } else {
    ImproveRelativePoses(foreign, settings.num_threads, scene);
  }
  return scene;
}

}  // namespace cairn
