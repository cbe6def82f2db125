#include "cairn/synthetic/view_graph_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "cairn/synthetic/rig.h"
#include "synthetic/edge_errors.h"
#include "synthetic/pair_choice.h"

namespace cairn {
namespace {

// How unlike two views are: the angle between their directions to the scene, and their distances
// from it.
double Unlikeness(const Eigen::Vector3d& center1, const Eigen::Vector3d& center2) {
  return 0.05 + AngleBetween(center1, center2) +
         0.3 * std::abs(std::log(center1.norm() / center2.norm()));
}

// Of very many pairs only those that are alike are candidates, some for each edge.
constexpr double kMaxCandidates = 1e9;
constexpr double kCandidatesPerEdge = 8;

// Pairs that are more unlike than that are none of the candidates.
double MaxUnlikeness(const std::vector<Eigen::Vector3d>& centers, size_t num_edges, uint64_t seed) {
  const auto n = static_cast<double>(centers.size());
  const double num_pairs = n * (n - 1) / 2;
  if (num_pairs <= kMaxCandidates) return std::numeric_limits<double>::infinity();
  Rng rng(seed, "view_graph_unlikeness");
  std::vector<double> sample(1'000'000);
  for (double& unlikeness : sample) {
    const uint32_t view2 = rng.UniformInt(centers.size());
    const uint32_t view1 = rng.UniformInt(centers.size());
    unlikeness = Unlikeness(centers[view1], centers[view2]);
  }
  const double share = kCandidatesPerEdge * static_cast<double>(num_edges) / num_pairs;
  const auto bound = sample.begin() + static_cast<int64_t>(std::min(share, 0.999) *
                                                           static_cast<double>(sample.size()));
  std::nth_element(sample.begin(), bound, sample.end());
  return *bound;
}

// Pairs of images, and how unlikely each is to be matched: how unlike they are, and chance.
std::vector<CandidatePair> MakeCandidates(const std::vector<Rigid3d>& poses, size_t num_edges,
                                          uint64_t seed) {
  Rng rng(seed, "view_graph_pairs");
  std::vector<Eigen::Vector3d> centers;
  std::vector<double> obscurity;  // some photographs match badly with all others
  for (const Rigid3d& pose : poses) {
    centers.push_back(pose.Center());
    obscurity.push_back(0.3 * rng.Gaussian());
  }
  const double max_unlikeness = MaxUnlikeness(centers, num_edges, seed);
  std::vector<CandidatePair> candidates;
  for (size_t i = 0; i < poses.size(); ++i) {
    for (size_t j = i + 1; j < poses.size(); ++j) {
      const double unlikeness = Unlikeness(centers[i], centers[j]);
      if (unlikeness > max_unlikeness) continue;
      const double chance = 0.3 * rng.Gaussian() + obscurity[i] + obscurity[j];
      candidates.push_back({static_cast<int>(i), static_cast<int>(j),
                            static_cast<float>(unlikeness * std::exp(chance))});
    }
  }
  return candidates;
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
  EdgeNoise::VisitFields(v);
  v.Double("outlier_ratio", outlier_ratio, {0.0, 1.0}, "share of edges that are random");
}

ViewGraphProblem MakeViewGraphProblem(const ViewGraphOptions& options, uint64_t seed) {
  ValidateOptions(options, "graph");
  RigOptions rig;
  rig.layout = options.layout;
  rig.num_images = options.num_images;
  ValidateOptions(rig, "");
  if (options.layout == CameraLayout::kCity) {
    throw ConfigError("layout", "city is of scenes; a graph alone has no places that look alike");
  }
  const size_t num_edges = NumEdges(options);
  Rng pose_rng(seed, "view_graph_poses");
  const std::vector<Rigid3d> poses =
      MakeCameraPoses(options.layout, options.num_images, options.distance, pose_rng);
  const std::vector<CandidatePair> candidates = MakeCandidates(poses, num_edges, seed);
  const std::vector<size_t> chosen = ChoosePairs(poses.size(), candidates, num_edges);

  Rng rng(seed, "view_graph_errors");
  const EdgeErrors errors(options, options.num_images, rng);
  std::vector<char> is_outlier(chosen.size(), 0);
  std::fill_n(is_outlier.begin(), std::lround(options.outlier_ratio * chosen.size()), 1);
  rng.Shuffle(is_outlier);

  ViewGraphProblem problem;
  for (size_t i = 0; i < poses.size(); ++i) {
    problem.graph.image_ids.push_back(i + 1);
    problem.cam_from_world[i + 1] = poses[i];
  }
  for (size_t k = 0; k < chosen.size(); ++k) {
    const auto [i, j, cost] = candidates[chosen[k]];
    const Rigid3d exact = poses[j] * Inverse(poses[i]);
    ViewEdge edge;
    edge.image_id1 = i + 1;
    edge.image_id2 = j + 1;
    edge.cam2_from_cam1 = {exact.rotation, exact.translation.normalized()};
    if (is_outlier[k]) {
      edge.cam2_from_cam1 = {RandomRotation(rng), RandomDirection(rng)};
    } else {
      errors.Perturb(i, j, rng, &edge.cam2_from_cam1);
    }
    const double error = AngleBetween(exact.rotation, edge.cam2_from_cam1.rotation);
    edge.num_inliers = NumInliers(cost, error, is_outlier[k], rng);
    problem.graph.edges.push_back(edge);
    problem.is_outlier.push_back(is_outlier[k]);
  }
  problem.graph.Normalize();
  return problem;
}

}  // namespace cairn
