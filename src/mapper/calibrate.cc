#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "base/text.h"
#include "cairn/base/parallel.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/intrinsics/focal_calibration.h"
#include "cairn/math/median.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "mapper/image_nodes.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

constexpr size_t kMaxMatches = 500;  // of a pair; more make its F no more precise than the model is

// Where the pixel would be without distortion.
std::optional<Eigen::Vector2d> UndistortedPixel(const Camera& camera,
                                                const Eigen::Vector2d& pixel) {
  const auto ray = camera.CamFromImg(pixel);
  if (!ray) return std::nullopt;
  return Eigen::Vector2d((camera.CalibrationMatrix() * ray->homogeneous()).head<2>());
}

// The pair's matches with the fundamental matrix to start from.
std::optional<FocalPair> MakePair(const SceneData& scene, const ViewEdge& edge,
                                  const TwoViewGeometry& geometry) {
  if (geometry.config != TwoViewConfig::kCalibrated &&
      geometry.config != TwoViewConfig::kUncalibrated) {
    return std::nullopt;
  }
  FocalPair pair;
  pair.camera_id1 = scene.CameraIdOf(edge.image_id1);
  pair.camera_id2 = scene.CameraIdOf(edge.image_id2);
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
    const auto pixel1 = UndistortedPixel(scene.cameras.at(pair.camera_id1),
                                         scene.pixels.at(edge.image_id1)[matches[i].point1]);
    const auto pixel2 = UndistortedPixel(scene.cameras.at(pair.camera_id2),
                                         scene.pixels.at(edge.image_id2)[matches[i].point2]);
    if (!pixel1 || !pixel2) continue;
    pair.pixels1.push_back(*pixel1);
    pair.pixels2.push_back(*pixel2);
  }
  return pair;
}

std::vector<FocalPair> CollectPairs(const SceneData& scene, int max_pairs, int num_threads) {
  std::vector<FocalPairCount> counts;
  std::vector<const ViewEdge*> edges;
  for (const ViewEdge& edge : scene.edges) {
    const camera_t camera_id1 = scene.CameraIdOf(edge.image_id1);
    const camera_t camera_id2 = scene.CameraIdOf(edge.image_id2);
    if (scene.constant_cameras.contains(camera_id1) &&
        scene.constant_cameras.contains(camera_id2)) {
      continue;
    }
    // Pixels of wide lenses have no fundamental matrix.
    if (!scene.cameras.at(camera_id1).IsPlanar() || !scene.cameras.at(camera_id2).IsPlanar()) {
      continue;
    }
    counts.push_back({camera_id1, camera_id2, edge.num_inliers});
    edges.push_back(&edge);
  }
  const std::vector<size_t> selected = SelectFocalPairs(counts, max_pairs);
  std::vector<TwoViewGeometry> geometries;
  for (const size_t i : selected) {
    geometries.push_back(scene.stored_geometry(edges[i]->PairId()));
  }
  std::vector<std::optional<FocalPair>> made(selected.size());
  ParallelFor(
      num_threads, std::ssize(selected),
      [&](int64_t i) { made[i] = MakePair(scene, *edges[selected[i]], geometries[i]); },
      /*grain=*/16);
  std::vector<FocalPair> pairs;
  for (auto& pair : made) {
    if (pair) pairs.push_back(std::move(*pair));
  }
  return pairs;
}

constexpr int kMaxLoops = 64;  // of an edge
// Standard deviations of a sign test from which loops decide: one decision in some hundreds is left
// to chance.
constexpr double kDecisive = 3.0;

// Cameras that are connected by pairs, and the closing errors of their loops of three rotations.
struct LoopErrors {
  std::set<camera_t> cameras;
  std::set<size_t> edges;  // that are in loops
  std::vector<double> before_deg, after_deg;

  // By how many standard deviations of chance more loops close better after than worse.
  // Loops share edges: no more of them count than there are edges.
  double Improvement() const {
    double balance = 0;
    for (size_t i = 0; i < before_deg.size(); ++i) {
      balance += after_deg[i] < before_deg[i] ? 1 : after_deg[i] > before_deg[i] ? -1 : 0;
    }
    const auto num = static_cast<double>(before_deg.size());
    const double num_independent = std::min(num, static_cast<double>(edges.size()));
    return num > 0 ? balance / num * std::sqrt(num_independent) : 0.0;
  }
};

// Of loops whose edges have poses in both `before` and `after`, which are alike in all but poses,
// and that close by one of them: loops with wrong pairs change by chance. A pixel is an angle in
// proportion to 1 / focal length, so that errors before count `before_scales` times.
std::vector<LoopErrors> CompareLoops(const SceneData& scene, double max_error_deg,
                                     const std::map<camera_t, double>& before_scales,
                                     const std::vector<ViewEdge>& before,
                                     const std::vector<ViewEdge>& after) {
  std::map<camera_t, int> node_of;  // a node a camera: an image's edges are its camera's
  const ImageNodes images(scene.images);
  std::vector<GraphEdge> image_graph, camera_graph;
  std::vector<size_t> index;
  for (const auto& [id, camera] : scene.cameras) {
    node_of.try_emplace(id, static_cast<int>(node_of.size()));
  }
  for (size_t i = 0; i < after.size(); ++i) {
    if (!before[i].IsActive() || !after[i].IsActive()) continue;
    const auto [id1, id2] = std::pair(after[i].image_id1, after[i].image_id2);
    image_graph.push_back(images.EdgeOf(after[i]));
    camera_graph.push_back({node_of.at(scene.CameraIdOf(id1)), node_of.at(scene.CameraIdOf(id2))});
    index.push_back(i);
  }
  const GraphComponents components =
      ConnectedComponents(static_cast<int>(node_of.size()), camera_graph);
  std::vector<LoopErrors> errors(components.Num());
  for (const auto& [id, node] : node_of) {
    errors[components.component_of_node[node]].cameras.insert(id);
  }
  const auto scale_of = [&](int node) {
    const auto scale = before_scales.find(scene.CameraIdOf(images.IdOf(node)));
    return scale != before_scales.end() ? scale->second : 1.0;
  };
  LoopFinder finder(images.size(), image_graph);
  for (size_t e = 0; e < image_graph.size(); ++e) {
    const auto [node1, node2] = image_graph[e];
    LoopErrors& loops = errors[components.component_of_node[camera_graph[e].node1]];
    for (const LoopFinder::Corner& corner : finder.Find(node1, node2, kMaxLoops)) {
      if (corner.node < std::max(node1, node2)) continue;  // It is another edge's.
      const auto error_deg = [&](const std::vector<ViewEdge>& edges) {
        return LoopErrorDeg(edges[index[e]], edges[index[corner.edge1]],
                            edges[index[corner.edge2]]);
      };
      const double scale = std::cbrt(scale_of(node1) * scale_of(node2) * scale_of(corner.node));
      const double before_deg = scale * error_deg(before), after_deg = error_deg(after);
      if (std::min(before_deg, after_deg) > max_error_deg) continue;
      loops.edges.insert({e, static_cast<size_t>(corner.edge1), static_cast<size_t>(corner.edge2)});
      loops.before_deg.push_back(before_deg);
      loops.after_deg.push_back(after_deg);
    }
  }
  return errors;
}

bool IsOf(const ViewEdge& edge, const std::set<camera_t>& cameras, const SceneData& scene) {
  return cameras.contains(scene.CameraIdOf(edge.image_id1)) ||
         cameras.contains(scene.CameraIdOf(edge.image_id2));
}

std::string Describe(camera_t id, const Camera& camera, const CalibratedFocal& focal) {
  return Formatted(
      "camera %u: focal length %.1f px (%s), by %d of %d pairs %.1f px (sigma %.1f %%): %s", id,
      focal.focal_before_px, camera.has_prior_focal_length ? "EXIF" : "guessed", focal.num_agreeing,
      focal.num_pairs, focal.focal_px, 100 * focal.sigma,
      std::string(FocalStatusName(focal.status)).c_str());
}

// Reports what became of each camera.
void Report(const FocalCalibrationReport& report, const std::map<camera_t, Camera>& cameras,
            Stage& stage) {
  std::map<FocalStatus, int> num_of;
  std::vector<std::string> notes, warnings;
  for (const auto& [id, focal] : report.cameras) {
    const bool is_exif = cameras.at(id).has_prior_focal_length;
    const std::string text = Describe(id, cameras.at(id), focal);
    ++num_of[focal.status];
    if (is_exif == (focal.status == FocalStatus::kCalibrated)) {
      warnings.push_back(text +
                         (is_exif ? "; EXIF's focal length is rejected" : "; the guess is kept"));
    } else {
      notes.push_back(text);
    }
  }
  stage.WarnEach(warnings);
  stage.NoteEach(notes);
  for (const auto& [status, count] : num_of) stage.Add(std::string(FocalStatusName(status)), count);
}

// Gives the cameras the focal lengths that the pairs found, and their edges poses by these. Returns
// the edges with poses at the focal lengths before.
std::vector<ViewEdge> TakeFocals(const std::map<camera_t, CalibratedFocal>& focals,
                                 const std::map<image_pair_t, TwoViewGeometry>& geometries,
                                 const std::set<camera_t>& cameras, const RunContext& run,
                                 SceneData& scene) {
  const std::vector<ViewEdge> stored = scene.edges;
  // The stored pose of an uncalibrated pair may be that of other focal lengths than the guessed
  // ones.
  std::map<image_pair_t, TwoViewGeometry> uncalibrated;
  for (const auto& [pair_id, geometry] : geometries) {
    if (geometry.config == TwoViewConfig::kUncalibrated) uncalibrated[pair_id] = geometry;
  }
  ImproveRelativePoses(uncalibrated, run, scene);
  std::vector<ViewEdge> before = std::exchange(scene.edges, stored);
  for (const camera_t id : cameras) scene.cameras.at(id).SetMeanFocal(focals.at(id).focal_px);
  ImproveRelativePoses(geometries, run, scene);
  return before;
}

// Loops of rotations judge the focal lengths that the pairs gave, for connected cameras together,
// by those of the focal lengths before. Where they close worse, the cameras and their edges are
// taken back, but for cameras whose EXIF pairs contradict: the stored poses are by EXIF.
void TakeBackRejected(const std::map<camera_t, CalibratedFocal>& focals,
                      const std::set<camera_t>& calibrated, double max_error_deg,
                      const std::vector<ViewEdge>& before, Stage& stage, SceneData& scene) {
  std::set<camera_t> rejected;
  std::map<camera_t, double> before_scales;
  for (const camera_t id : calibrated) {
    before_scales[id] = focals.at(id).focal_before_px / focals.at(id).focal_px;
  }
  for (const LoopErrors& loops :
       CompareLoops(scene, max_error_deg, before_scales, before, scene.edges)) {
    std::set<camera_t> cameras;
    std::ranges::set_intersection(loops.cameras, calibrated, std::inserter(cameras, cameras.end()));
    const bool overrules_exif = std::ranges::any_of(
        cameras, [&](camera_t id) { return scene.cameras.at(id).has_prior_focal_length; });
    if (cameras.empty() || loops.Improvement() > -kDecisive) continue;
    if (!overrules_exif) rejected.insert(cameras.begin(), cameras.end());
    stage.Note(Formatted(
        "%zu loops of rotations close to %.2f deg (median) with calibrated focal lengths, "
        "to %.2f deg, in pixels, without: the calibrated focal lengths of %zu cameras are %s",
        loops.before_deg.size(), UpperMedian(loops.after_deg), UpperMedian(loops.before_deg),
        cameras.size(), overrules_exif ? "kept, since pairs contradict EXIF" : "rejected"));
  }
  for (const camera_t id : rejected) {
    scene.cameras.at(id).SetMeanFocal(focals.at(id).focal_before_px);
  }
  for (size_t i = 0; i < scene.edges.size(); ++i) {
    if (IsOf(scene.edges[i], rejected, scene)) scene.edges[i] = before[i];
  }
  stage.Add("rejected_by_loops", rejected.size());
}

// Whether the pairs tell that a camera which images share is more than one: two lenses by which a
// fifth and more of the photographs are each meet in a third of the pairs and more, and these agree
// with neither.
bool IsSharingDisputed(const FocalCalibrationReport& report, const SceneData& scene) {
  return std::ranges::any_of(scene.stored_cameras, [&](const auto& entry) {
    const auto focal = report.cameras.find(scene.CameraIdOf(entry.first));
    return focal != report.cameras.end() &&
           3 * focal->second.num_agreeing < 2 * focal->second.num_pairs;
  });
}

}  // namespace

std::map<image_pair_t, TwoViewGeometry> ReadGeometriesOf(const std::set<camera_t>& cameras,
                                                         const SceneData& scene) {
  std::map<image_pair_t, TwoViewGeometry> geometries;
  for (const ViewEdge& edge : scene.edges) {
    if (!IsOf(edge, cameras, scene)) continue;
    TwoViewGeometry& geometry = geometries[edge.PairId()] = scene.stored_geometry(edge.PairId());
    geometry.inlier_matches = {};  // the scene has them
  }
  return geometries;
}

bool CalibrateSceneFocals(const ReconstructSettings& settings, const RunContext& run, Stage& stage,
                          SceneData& scene) {
  const FocalCalibrationOptions& options = settings.focal_calibration;
  const std::vector<FocalPair> pairs = CollectPairs(scene, options.max_pairs, run.num_threads);
  std::set<camera_t> trusted = scene.constant_cameras;
  for (const auto& [id, sigma] : scene.held_focals) trusted.insert(id);
  const FocalCalibrationReport report =
      CalibrateFocals(scene.cameras, trusted, pairs, options, run);
  stage.Add("pairs_in", pairs.size());
  stage.Add("pairs_used", report.num_pairs);
  stage.Add("pairs_agreeing", report.num_pairs_agreeing);
  std::set<camera_t> calibrated;
  for (const auto& [id, focal] : report.cameras) {
    scene.focals_by_pairs[id] = focal;
    if (focal.status == FocalStatus::kCalibrated) calibrated.insert(id);
  }
  Report(report, scene.cameras, stage);
  const bool is_sharing_disputed = IsSharingDisputed(report, scene);
  stage.Add("sharing_disputed", is_sharing_disputed);
  ImproveRelativePoses(scene.foreign, run, scene);
  if (calibrated.empty()) return is_sharing_disputed;
  const std::vector<ViewEdge> before =
      TakeFocals(report.cameras, ReadGeometriesOf(calibrated, scene), calibrated, run, scene);
  TakeBackRejected(report.cameras, calibrated, settings.view_graph.max_triplet_error_deg, before,
                   stage, scene);
  return is_sharing_disputed;
}

}  // namespace cairn
