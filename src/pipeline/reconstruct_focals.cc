#include <Eigen/LU>
#include <cstdio>

#include "cairn/geometry/epipolar.h"
#include "cairn/view_graph/focal_calibration.h"
#include "pipeline/reconstruct_stages.h"

namespace cairn {
namespace {

constexpr size_t kMaxMatches = 500;  // of a pair; more make its F no surer than the model is

// The pair's matches with the fundamental matrix to start from.
std::optional<FocalPair> MakePair(const SceneData& scene, const ViewEdge& edge,
                                  const TwoViewGeometry& geometry) {
  if (geometry.config != TwoViewConfig::kCalibrated &&
      geometry.config != TwoViewConfig::kUncalibrated) {
    return std::nullopt;
  }
  FocalPair pair;
  pair.camera_id1 = scene.images.at(edge.image_id1).camera_id;
  pair.camera_id2 = scene.images.at(edge.image_id2).camera_id;
  if (geometry.F && geometry.F->allFinite() && geometry.F->norm() > 0) {
    pair.F = *geometry.F;
  } else if (geometry.E || edge.IsActive()) {
    const Eigen::Matrix3d E = geometry.E ? *geometry.E : EssentialFromPose(edge.cam2_from_cam1);
    pair.F = FundamentalFromEssential(E, scene.cameras.at(pair.camera_id1).CalibrationMatrix(),
                                      scene.cameras.at(pair.camera_id2).CalibrationMatrix());
  } else {
    return std::nullopt;
  }
  const FeatureMatches& matches = scene.matches.at(edge.PairId());
  const size_t step = 1 + matches.size() / kMaxMatches;
  for (size_t i = 0; i < matches.size(); i += step) {
    pair.pixels1.push_back(scene.pixels.at(edge.image_id1)[matches[i].point1]);
    pair.pixels2.push_back(scene.pixels.at(edge.image_id2)[matches[i].point2]);
  }
  return pair;
}

std::vector<FocalPair> CollectPairs(const SceneData& scene, const GeometryReader& read,
                                    int max_pairs) {
  std::vector<FocalPairCount> counts;
  std::vector<const ViewEdge*> edges;
  for (const ViewEdge& edge : scene.edges) {
    const camera_t camera_id1 = scene.images.at(edge.image_id1).camera_id;
    const camera_t camera_id2 = scene.images.at(edge.image_id2).camera_id;
    if (scene.held_cameras.count(camera_id1) > 0 && scene.held_cameras.count(camera_id2) > 0) {
      continue;
    }
    counts.push_back({camera_id1, camera_id2, edge.num_inliers});
    edges.push_back(&edge);
  }
  std::vector<FocalPair> pairs;
  for (const size_t i : SelectFocalPairs(counts, max_pairs)) {
    auto pair = MakePair(scene, *edges[i], read(edges[i]->PairId()));
    if (pair) pairs.push_back(std::move(*pair));
  }
  return pairs;
}

std::string Describe(camera_t id, const Camera& camera, const CalibratedFocal& focal) {
  char text[200];
  std::snprintf(
      text, sizeof(text),
      "camera %u: focal length %.1f px (%s), by %d of %d pairs %.1f px (sigma %.1f %%): %s", id,
      focal.focal_before_px, camera.has_prior_focal_length ? "EXIF" : "guessed", focal.num_agreeing,
      focal.num_pairs, focal.focal_px, 100 * focal.sigma,
      std::string(FocalStatusName(focal.status)).c_str());
  return text;
}

}  // namespace

std::set<camera_t> CalibrateSceneFocals(const GeometryReader& read,
                                        const ReconstructSettings& settings, Stage& stage,
                                        SceneData& scene) {
  std::set<camera_t> changed;
  const std::vector<FocalPair> pairs =
      CollectPairs(scene, read, settings.focal_calibration.max_pairs);
  const FocalCalibrationReport report = CalibrateFocals(
      scene.cameras, scene.held_cameras, pairs, settings.focal_calibration, settings.num_threads);
  std::map<FocalStatus, int> num_of;
  for (const auto& [id, focal] : report.cameras) {
    Camera& camera = scene.cameras.at(id);
    const std::string text = Describe(id, camera, focal);
    ++num_of[focal.status];
    if (focal.status == FocalStatus::kCalibrated) {
      camera.SetMeanFocal(focal.focal_px);
      changed.insert(id);
    }
    const bool is_overruled =
        camera.has_prior_focal_length && focal.status == FocalStatus::kCalibrated;
    const bool is_unknown =
        !camera.has_prior_focal_length && focal.status != FocalStatus::kCalibrated;
    if (is_overruled || is_unknown) {
      stage.Warn(text + (is_unknown ? "; the guess is kept" : "; EXIF is overruled"));
    } else {
      stage.Note(text);
    }
  }
  stage.Add("pairs_in", static_cast<double>(pairs.size()));
  stage.Add("pairs_used", report.num_pairs);
  stage.Add("pairs_agreeing", report.num_pairs_agreeing);
  for (const auto& [status, count] : num_of) stage.Add(std::string(FocalStatusName(status)), count);
  return changed;
}

}  // namespace cairn
