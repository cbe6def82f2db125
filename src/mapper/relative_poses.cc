#include <Eigen/LU>
#include <algorithm>

#include "cairn/base/parallel.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/mapper/view_edges.h"
#include "cairn/math/angles.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/median.h"
#include "cairn/solvers/homography.h"
#include "mapper/stages.h"
#include "robust/match_errors.h"
#include "robust/pose_refinement.h"

namespace cairn {
namespace {

// Times the pair's error scale, as other errors in pixels here:
constexpr double kWidePx = 8.0;  // a pose from a decomposition is rough
constexpr double kFinePx = 2.0;
// So many inliers off the rotation tell the direction, however many more are far away. (Wrong
// matches that fit by chance, the hundredth part of them, are fewer.)
constexpr int kEnoughNear = 30;

// Unit bearings of the matches whose distortion can be undone.
struct PairRays {
  std::vector<Eigen::Vector3d> rays1, rays2;
  PointPairs points;
  double error_scale = 1.0;  // Camera::ErrorScale, the larger one
};

PairRays RaysOf(const SceneData& scene, const ViewEdge& edge) {
  const Camera& camera1 = scene.CameraOf(edge.image_id1);
  const Camera& camera2 = scene.CameraOf(edge.image_id2);
  const std::vector<Eigen::Vector2d>& pixels1 = scene.pixels.at(edge.image_id1);
  const std::vector<Eigen::Vector2d>& pixels2 = scene.pixels.at(edge.image_id2);
  const FeatureMatches& matches = scene.matches.at(edge.PairId());
  PairRays rays;
  rays.error_scale = std::max(camera1.ErrorScale(), camera2.ErrorScale());
  rays.points.Reset(static_cast<int>(matches.size()), camera1, camera2);
  for (const FeatureMatch& match : matches) {
    const Eigen::Vector2d &pixel1 = pixels1[match.point1], &pixel2 = pixels2[match.point2];
    const int i = static_cast<int>(rays.rays1.size());
    if (!rays.points.SetPixels(i, camera1, pixel1, camera2, pixel2)) continue;
    rays.rays1.push_back(camera1.RayFromImg(pixel1).value());
    rays.rays2.push_back(camera2.RayFromImg(pixel2).value());
  }
  rays.points.Truncate(static_cast<int>(rays.rays1.size()));
  return rays;
}

// Poses to start from: what is stored, and what E, F and H decompose to.
std::vector<Rigid3d> Candidates(const SceneData& scene, const ViewEdge& edge,
                                const TwoViewGeometry& geometry) {
  const Camera& camera1 = scene.CameraOf(edge.image_id1);
  const Camera& camera2 = scene.CameraOf(edge.image_id2);
  const Eigen::Matrix3d K1 = camera1.CalibrationMatrix(), K2 = camera2.CalibrationMatrix();
  std::vector<Rigid3d> candidates;
  if (edge.IsActive() && edge.HasTranslation()) candidates.push_back(edge.cam2_from_cam1);
  const auto add_essential = [&](const Eigen::Matrix3d& E) {
    // Any of its four poses: they have the same epipolar errors.
    candidates.push_back(PosesFromEssential(NearestEssential(E))[0]);
  };
  if (geometry.E && geometry.E->allFinite() && geometry.E->norm() > 0) add_essential(*geometry.E);
  // (F and H of pixels mean nothing where lenses bend straight lines by far.)
  if (!camera1.IsPlanar() || !camera2.IsPlanar()) return candidates;
  if (geometry.F && geometry.F->allFinite() && geometry.F->norm() > 0) {
    add_essential(K2.transpose() * *geometry.F * K1);
  }
  if (geometry.H && geometry.H->allFinite() && std::abs(geometry.H->determinant()) > 0) {
    PlaneMotion motions[4];
    const int n = DecomposeHomography(K2.inverse() * *geometry.H * K1, motions);
    for (int i = 0; i < n; ++i) {
      Rigid3d pose = motions[i].cam2_from_cam1;
      if (!(pose.translation.norm() > 1e-9)) continue;
      pose.translation.normalize();
      candidates.push_back(pose);
    }
  }
  return candidates;
}

// The best two by soft support, refined, first with a wide scale: the one with more support.
Rigid3d RefineBest(const PairRays& rays, const std::vector<Rigid3d>& candidates) {
  const PointPairs& points = rays.points;
  const double wide_px = kWidePx * rays.error_scale, fine_px = kFinePx * rays.error_scale;
  std::vector<std::pair<double, size_t>> order;
  for (size_t i = 0; i < candidates.size(); ++i) {
    order.emplace_back(-SoftScoreSampson(points, EssentialFromPose(candidates[i]), wide_px), i);
  }
  std::sort(order.begin(), order.end());
  double best_score = -1;
  Rigid3d best;
  for (size_t k = 0; k < std::min<size_t>(2, order.size()); ++k) {
    Rigid3d pose = candidates[order[k].second];
    for (const double scale_px : {wide_px, fine_px}) {
      pose = RefinePose(points, pose, {.loss = RobustLoss::kGemanMcClure, .scale_px = scale_px});
    }
    const double score = ScoreSampson(points, EssentialFromPose(pose), fine_px);
    if (score > best_score) {
      best_score = score;
      best = pose;
    }
  }
  return best;
}

// The pose that the inliers support best, without translation if they show no parallax; the edge is
// without one if there is none.
void ImproveEdge(const SceneData& scene, const TwoViewGeometry& geometry, ViewEdge& edge) {
  const PairRays rays = RaysOf(scene, edge);
  const PointPairs& points = rays.points;
  std::vector<Rigid3d> candidates = Candidates(scene, edge, geometry);
  // A rotation that is stored without anything else is all that there is.
  if (candidates.empty() && edge.IsActive()) return;
  edge.removal = EdgeRemoval::kNoPose;
  if (points.size() < 8 || candidates.empty()) return;

  const Rigid3d best = RefineBest(rays, candidates);
  const MatchErrors errors(points, EssentialFromPose(best));
  std::vector<Eigen::Vector3d> inliers1, inliers2;
  std::vector<double> parallaxes, inlier_errors;
  for (int i = 0; i < points.size(); ++i) {
    if (errors[i] > 2 * kFinePx * rays.error_scale) continue;
    inliers1.push_back(rays.rays1[i]);
    inliers2.push_back(rays.rays2[i]);
    inlier_errors.push_back(errors[i]);
  }
  if (inliers1.size() < 8) return;
  // The four poses of an essential matrix have equal epipolar errors.
  const CheiralityResult front =
      SelectPoseByCheirality(EssentialFromPose(best), inliers1, inliers2);
  if (2 * front.num_in_front < static_cast<int>(inliers1.size())) return;
  for (size_t i = 0; i < inliers1.size(); ++i) {
    const Eigen::Vector3d x = front.cam2_from_cam1.rotation * inliers1[i];
    parallaxes.push_back(points.focal2_px() * AngleBetween(x, inliers2[i]));
  }
  const double parallax_px = UpperMedian(parallaxes);
  const double min_parallax_px = kMinParallaxPx * rays.error_scale;
  const auto num_near =
      std::ranges::count_if(parallaxes, [&](double px) { return px >= min_parallax_px; });
  const bool is_rotation = parallax_px < min_parallax_px && num_near < kEnoughNear;
  if (is_rotation && !HasTurned(front.cam2_from_cam1.rotation)) return;
  edge.removal = EdgeRemoval::kNone;
  if (is_rotation) {
    edge.cam2_from_cam1 = Rigid3d(front.cam2_from_cam1.rotation, Eigen::Vector3d::Zero());
    return;
  }
  edge.cam2_from_cam1 = front.cam2_from_cam1;
  edge.residual_px = UpperMedian(inlier_errors);
  edge.triangulation_angle_deg = RadToDeg(parallax_px / points.focal2_px());
}

// The direction of translation that fits a known rotation: perpendicular to the normals of all
// epipolar planes, by reweighted least squares.
Eigen::Vector3d TranslationFor(const Eigen::Matrix3d& R, const PairRays& rays) {
  constexpr int kIterations = 10;
  const double focal_px = rays.points.focal2_px() / rays.error_scale;
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
    for (size_t i = 0; i < rays.rays1.size(); ++i) {
      const Eigen::Vector3d x1 = R * rays.rays1[i];
      const Eigen::Vector3d normal = x1.cross(rays.rays2[i]);
      const double error_px = focal_px * normal.dot(t) / kWidePx;
      const double weight = 1.0 / ((1.0 + error_px * error_px) * (1.0 + error_px * error_px));
      M += weight * normal * normal.transpose();
    }
    t = SymmetricEigen(M).vectors.col(0);
  }
  return t;
}

// How many of the pair's matches a pose explains: near their epipolar lines, in front.
int NumExplained(const PairRays& rays, const Rigid3d& pose) {
  const MatchErrors errors(rays.points, EssentialFromPose(pose));
  const CheiralityTest test(pose);
  int num_explained = 0;
  for (size_t i = 0; i < rays.rays1.size(); ++i) {
    num_explained +=
        errors[i] < kFinePx * rays.error_scale && test.IsInFront(rays.rays1[i], rays.rays2[i]);
  }
  return num_explained;
}

// False: no pose near the rotation explains the matches.
bool RefitEdge(const SceneData& scene, const Eigen::Quaterniond& rotation, double max_error_deg,
               ViewEdge& edge) {
  const PairRays rays = RaysOf(scene, edge);
  if (rays.rays1.size() < 8) return false;
  const Rigid3d start(rotation, TranslationFor(rotation.toRotationMatrix(), rays));
  Rigid3d pose =
      RefinePose(rays.points, start,
                 {.loss = RobustLoss::kGemanMcClure, .scale_px = kFinePx * rays.error_scale});
  if (RadToDeg(AngleBetween(pose.rotation, rotation)) > max_error_deg) pose = start;
  const Rigid3d back(pose.rotation, Eigen::Vector3d(-pose.translation));
  const int num_pose = NumExplained(rays, pose);
  const int num_back = NumExplained(rays, back);
  if (2 * std::max(num_pose, num_back) < static_cast<int>(rays.rays1.size())) return false;
  edge.cam2_from_cam1 = num_back > num_pose ? back : pose;
  edge.removal = EdgeRemoval::kNone;
  return true;
}

}  // namespace

int RefitEdges(const StageContext& context,
               const std::map<image_t, Eigen::Quaterniond>& cam_from_world, double max_error_deg,
               ViewGraph& graph) {
  std::vector<std::pair<ViewEdge*, Eigen::Quaterniond>> edges;
  for (ViewEdge& edge : graph.edges) {
    const auto rotation = RelativeRotation(edge, cam_from_world);
    if (!rotation || edge.removal == EdgeRemoval::kNoPose ||
        edge.removal == EdgeRemoval::kAmbiguous || !edge.HasTranslation()) {
      continue;
    }
    const double error = AngleBetween(*rotation, edge.cam2_from_cam1.rotation);
    if (RadToDeg(error) > max_error_deg) edges.emplace_back(&edge, *rotation);
  }
  std::vector<char> is_refitted(edges.size(), 0);
  ParallelFor(context.run.num_threads, static_cast<int64_t>(edges.size()), [&](int64_t i) {
    is_refitted[i] = RefitEdge(context.scene, edges[i].second, max_error_deg, *edges[i].first);
  });
  return static_cast<int>(std::count(is_refitted.begin(), is_refitted.end(), 1));
}

void ImproveRelativePoses(const std::map<image_pair_t, TwoViewGeometry>& geometries,
                          const RunContext& run, SceneData& scene) {
  std::vector<ViewEdge*> edges;
  for (ViewEdge& edge : scene.edges) {
    if (geometries.contains(edge.PairId())) edges.push_back(&edge);
  }
  ParallelFor(run.num_threads, static_cast<int64_t>(edges.size()),
              [&](int64_t i) { ImproveEdge(scene, geometries.at(edges[i]->PairId()), *edges[i]); });
}

}  // namespace cairn
