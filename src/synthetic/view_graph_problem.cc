#include "cairn/synthetic/view_graph_problem.h"

#include <algorithm>
#include <cmath>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "cairn/synthetic/poses.h"
#include "cairn/synthetic/rig.h"
#include "synthetic/city.h"
#include "synthetic/edge_errors.h"
#include "synthetic/pair_choice.h"

namespace cairn {
namespace {

// How unlikely two images are to be matched: from the angle between their directions to the scene,
// their distances from it, and chance.
PairCosts MakeCosts(const std::vector<Rigid3d>& poses, Rng& rng) {
  std::vector<Eigen::Vector3d> centers;
  std::vector<double> obscurity;  // some photographs match badly with all others
  for (const Rigid3d& pose : poses) {
    centers.push_back(pose.Center());
    obscurity.push_back(0.3 * rng.Gaussian());
  }
  PairCosts costs(poses.size());
  size_t pair = 0;
  for (size_t i = 0; i < poses.size(); ++i) {
    for (size_t j = i + 1; j < poses.size(); ++j, ++pair) {
      const double angle = AngleBetween(centers[i], centers[j]);
      const double zoom = std::abs(std::log(centers[i].norm() / centers[j].norm()));
      const double chance = 0.3 * rng.Gaussian() + obscurity[i] + obscurity[j];
      costs[pair] = static_cast<float>((0.05 + angle + 0.3 * zoom) * std::exp(chance));
    }
  }
  return costs;
}

// An edge before it has a pose.
struct PlannedEdge {
  size_t i = 0, j = 0;
  float cost = 0;
  bool is_outlier = false;
};

std::vector<PlannedEdge> PlanEdges(const std::vector<Rigid3d>& poses, size_t num_edges,
                                   uint64_t seed) {
  Rng rng(seed, "view_graph_pairs");
  const PairCosts costs = MakeCosts(poses, rng);
  const std::vector<bool> chosen = ChoosePairs(costs, num_edges);
  std::vector<PlannedEdge> edges;
  size_t pair = 0;
  for (size_t i = 0; i < poses.size(); ++i) {
    for (size_t j = i + 1; j < poses.size(); ++j, ++pair) {
      if (chosen[pair]) edges.push_back({i, j, costs[pair], false});
    }
  }
  return edges;
}

// Edges of neighboring places, and wrong ones of those that look alike; costs as above, around the
// middle between the two places.
std::vector<PlannedEdge> PlanCityEdges(const std::vector<Rigid3d>& poses, size_t num_edges,
                                       double outlier_ratio, uint64_t seed) {
  Rng rng(seed, "view_graph_pairs");
  const City city(static_cast<int64_t>(poses.size()));
  std::vector<double> obscurity;
  for (size_t i = 0; i < poses.size(); ++i) obscurity.push_back(0.3 * rng.Gaussian());
  std::vector<CandidatePair> candidates[2];  // true and wrong ones
  for (size_t i = 0; i < poses.size(); ++i) {
    const int place1 = city.PlaceOf(i);
    const Eigen::Vector3d middle1 = city.WorldFromPlace(place1).translation;
    for (size_t j = i + 1; j < poses.size(); ++j) {
      const int place2 = city.PlaceOf(j);
      const bool is_wrong = !city.AreNeighbors(place1, place2);
      if (is_wrong && place2 != city.TwinOf(place1)) continue;
      const Eigen::Vector3d center1 = poses[i].Center();
      const Eigen::Vector3d center2 =
          is_wrong ? city.Motion(place2, place1) * poses[j].Center() : poses[j].Center();
      const Eigen::Vector3d middle =
          is_wrong ? middle1 : 0.5 * (middle1 + city.WorldFromPlace(place2).translation);
      const double distance1 = (center1 - middle).norm(), distance2 = (center2 - middle).norm();
      const double angle = AngleBetween(center1 - middle, center2 - middle);
      const double chance = 0.3 * rng.Gaussian() + obscurity[i] + obscurity[j];
      candidates[is_wrong].push_back(
          {static_cast<int>(i), static_cast<int>(j),
           static_cast<float>((0.05 + angle + 0.3 * std::abs(std::log(distance1 / distance2))) *
                              std::exp(chance))});
    }
  }
  std::vector<PlannedEdge> edges;
  const auto num_wrong =
      static_cast<size_t>(std::lround(outlier_ratio * static_cast<double>(num_edges)));
  for (const bool is_wrong : {false, true}) {
    const std::vector<CandidatePair>& of_kind = candidates[is_wrong];
    for (const size_t k :
         ChoosePairs(poses.size(), of_kind, is_wrong ? num_wrong : num_edges - num_wrong)) {
      edges.push_back({static_cast<size_t>(of_kind[k].item1), static_cast<size_t>(of_kind[k].item2),
                       of_kind[k].cost, is_wrong});
    }
  }
  std::sort(edges.begin(), edges.end(),
            [](const auto& a, const auto& b) { return std::pair(a.i, a.j) < std::pair(b.i, b.j); });
  return edges;
}

int NumInliers(float cost, double rotation_error_rad, bool is_outlier, Rng& rng) {
  if (is_outlier) return NumChanceInliers(rng);
  const double expected =
      600.0 * std::exp(-3.0 * cost) / (1.0 + RadToDeg(rotation_error_rad) / 10.0);
  return 15 + static_cast<int>(expected * std::exp(0.4 * rng.Gaussian()));
}

size_t NumEdges(const ViewGraphOptions& options) {
  const int64_t n = options.num_images;
  const int64_t num_pairs = n * (n - 1) / 2;
  if (options.num_edges == 0) return std::min(20 * n, num_pairs);
  if (options.num_edges < n - 1 || options.num_edges > num_pairs) {
    throw ConfigError("graph.num_edges", std::to_string(options.num_edges) + " for " +
                                             std::to_string(n) + " images; from " +
                                             std::to_string(n - 1) + " to " +
                                             std::to_string(num_pairs) + " are possible");
  }
  return options.num_edges;
}

}  // namespace

void ViewGraphOptions::VisitFields(OptionVisitor& v) {
  v.Int("num_edges", num_edges, {0, 2e8},
        "edges of the graph; 0: 20 an image, or all pairs where there are fewer");
  v.Double("rotation_noise_deg", rotation_noise_deg, {0.0, 180.0},
           "median rotation error of an edge");
  v.Double("direction_noise_deg", direction_noise_deg, {0.0, 180.0},
           "median error of an edge's translation direction");
  v.Double("heavy_tail", heavy_tail, {0.0, 1.0},
           "0: light-tailed errors; 1: as in real 1DSfM edges");
  v.Double("outlier_ratio", outlier_ratio, {0.0, 1.0}, "share of edges that are random");
}

ViewGraphProblem MakeViewGraphProblem(const ViewGraphOptions& options, uint64_t seed) {
  ValidateOptions(options, "graph");
  RigOptions rig;
  rig.layout = options.layout;
  rig.num_images = options.num_images;
  ValidateOptions(rig, "");
  const size_t n = options.num_images;
  const size_t num_edges = NumEdges(options);
  Rng pose_rng(seed, "view_graph_poses");
  const std::vector<Rigid3d> poses =
      MakeCameraPoses(options.layout, options.num_images, 3.0, pose_rng);
  const bool is_city = options.layout == CameraLayout::kCity;
  std::vector<PlannedEdge> edges =
      is_city ? PlanCityEdges(poses, num_edges, options.outlier_ratio, seed)
              : PlanEdges(poses, num_edges, seed);

  Rng rng(seed, "view_graph_errors");
  const EdgeErrors errors(
      {options.rotation_noise_deg, options.direction_noise_deg, options.heavy_tail},
      options.num_images, rng);
  if (!is_city) {
    std::vector<char> is_outlier(edges.size(), 0);
    std::fill_n(is_outlier.begin(), std::lround(options.outlier_ratio * edges.size()), 1);
    rng.Shuffle(is_outlier);
    for (size_t k = 0; k < edges.size(); ++k) edges[k].is_outlier = is_outlier[k];
  }

  const City city(static_cast<int64_t>(n));
  ViewGraphProblem problem;
  for (size_t i = 0; i < n; ++i) {
    problem.graph.image_ids.push_back(i + 1);
    problem.cam_from_world[i + 1] = poses[i];
  }
  for (const auto& [i, j, cost, is_outlier] : edges) {
    const bool is_twin = is_city && is_outlier;
    const Rigid3d exact =
        (is_twin ? poses[j] * city.Motion(city.PlaceOf(i), city.PlaceOf(j)) : poses[j]) *
        Inverse(poses[i]);
    ViewEdge edge;
    edge.image_id1 = i + 1;
    edge.image_id2 = j + 1;
    edge.cam2_from_cam1 = {exact.rotation, exact.translation.normalized()};
    if (is_outlier && !is_twin) {
      edge.cam2_from_cam1 = {RandomRotation(rng), RandomDirection(rng)};
    } else {
      errors.Perturb(i, j, rng, &edge.cam2_from_cam1);
    }
    const double error = AngleBetween(exact.rotation, edge.cam2_from_cam1.rotation);
    edge.num_inliers = NumInliers(cost, error, is_outlier && !is_twin, rng);
    if (is_twin) edge.num_inliers = std::max(15, edge.num_inliers / 3);
    problem.graph.edges.push_back(edge);
    problem.is_outlier.push_back(is_outlier);
  }
  problem.graph.Normalize();
  return problem;
}

}  // namespace cairn
