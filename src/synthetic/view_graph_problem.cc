#include "cairn/synthetic/view_graph_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/poses.h"
#include "cairn/synthetic/rig.h"

namespace cairn {
namespace {

// How unlikely two images are to be matched: from the angle between their directions to the scene,
// their distances from it, and chance. Upper triangle, row by row.
class PairCosts {
 public:
  PairCosts(const std::vector<Rigid3d>& poses, Rng& rng) : n_(poses.size()) {
    std::vector<Eigen::Vector3d> centers;
    std::vector<double> obscurity;  // some photographs match badly with all others
    for (const Rigid3d& pose : poses) {
      centers.push_back(pose.Center());
      obscurity.push_back(0.3 * rng.Gaussian());
    }
    costs_.reserve(n_ * (n_ - 1) / 2);
    for (size_t i = 0; i < n_; ++i) {
      for (size_t j = i + 1; j < n_; ++j) {
        const double angle = AngleBetween(centers[i], centers[j]);
        const double zoom = std::abs(std::log(centers[i].norm() / centers[j].norm()));
        const double chance = 0.3 * rng.Gaussian() + obscurity[i] + obscurity[j];
        costs_.push_back(static_cast<float>((0.05 + angle + 0.3 * zoom) * std::exp(chance)));
      }
    }
  }
  size_t NumPairs() const { return costs_.size(); }
  float operator[](size_t pair) const { return costs_[pair]; }
  // Index of the pair i != j.
  size_t Pair(size_t i, size_t j) const {
    if (i > j) std::swap(i, j);
    return i * (2 * n_ - i - 1) / 2 + (j - i - 1);
  }

 private:
  size_t n_;
  std::vector<float> costs_;
};

// Pairs of a minimum spanning tree (Prim 1957, dense).
std::vector<size_t> SpanningTree(const PairCosts& costs, size_t n) {
  std::vector<float> nearest(n, std::numeric_limits<float>::infinity());
  std::vector<size_t> parent(n, 0);
  std::vector<bool> done(n, false);
  std::vector<size_t> tree;
  size_t node = 0;
  for (size_t step = 1; step < n; ++step) {
    done[node] = true;
    size_t next = n;
    for (size_t k = 0; k < n; ++k) {
      if (done[k]) continue;
      const float cost = costs[costs.Pair(node, k)];
      if (cost < nearest[k]) {
        nearest[k] = cost;
        parent[k] = node;
      }
      if (next == n || nearest[k] < nearest[next]) next = k;
    }
    tree.push_back(costs.Pair(parent[next], next));
    node = next;
  }
  return tree;
}

// The tree's pairs and the cheapest others, as a flag a pair.
std::vector<bool> ChoosePairs(const PairCosts& costs, size_t n, size_t num_edges) {
  std::vector<bool> chosen(costs.NumPairs(), false);
  for (const size_t pair : SpanningTree(costs, n)) chosen[pair] = true;
  std::vector<size_t> others;
  for (size_t pair = 0; pair < costs.NumPairs(); ++pair) {
    if (!chosen[pair]) others.push_back(pair);
  }
  const size_t num_others = num_edges - (n - 1);
  std::nth_element(
      others.begin(), others.begin() + num_others, others.end(),
      [&](size_t a, size_t b) { return costs[a] != costs[b] ? costs[a] < costs[b] : a < b; });
  for (size_t k = 0; k < num_others; ++k) chosen[others[k]] = true;
  return chosen;
}

// Errors of edges, as angles in radians. At heavy_tail = 0 their distribution is near Rayleigh's.
// At 1 it is log-normal with the spread that the real edges of 1DSfM's Ellis Island have around
// their median (2.9 degrees; a tenth of the edges is off by more than 37 degrees), where bad
// photographs have many bad edges and most errors turn around the image's x and y axes.
class ErrorModel {
 public:
  ErrorModel(const ViewGraphOptions& options, Rng& rng) : options_(options) {
    for (int i = 0; i < options.num_images; ++i) badness_.push_back(rng.Gaussian());
  }

  void Perturb(size_t i, size_t j, Rng& rng, Rigid3d* cam2_from_cam1) const {
    const double tail = options_.heavy_tail;
    const double z = std::sqrt(1.0 - 0.4 * tail) * rng.Gaussian() +
                     std::sqrt(0.2 * tail) * (badness_[i] + badness_[j]);
    const double rotation_error = Angle(options_.rotation_noise_deg, z);
    const double direction_error =
        Angle(options_.direction_noise_deg, 0.8 * z + 0.6 * rng.Gaussian());
    const Eigen::Vector3d axis(rng.Gaussian() * (1.0 - 0.2 * tail),
                               rng.Gaussian() * (1.0 + 0.2 * tail),
                               rng.Gaussian() * (1.0 - 0.6 * tail));
    cam2_from_cam1->rotation =
        (ExpSO3(rotation_error * axis.normalized()) * cam2_from_cam1->rotation).normalized();
    const Eigen::Vector3d turn =
        cam2_from_cam1->translation.cross(RandomDirection(rng)).normalized();
    cam2_from_cam1->translation = ExpSO3(direction_error * turn) * cam2_from_cam1->translation;
  }

 private:
  double Angle(double median_deg, double z) const {
    const double spread =
        z < 0 ? 0.35 + 0.25 * options_.heavy_tail : 0.19 + 0.61 * options_.heavy_tail;
    return DegToRad(std::min(180.0, median_deg * std::pow(10.0, spread * z)));
  }

  const ViewGraphOptions& options_;
  std::vector<double> badness_;
};

int NumInliers(float cost, double rotation_error_rad, bool is_outlier, Rng& rng) {
  if (is_outlier) return 15 + static_cast<int>(-20.0 * std::log(1.0 - rng.Uniform()));
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
  v.Double("outlier_ratio", outlier_ratio, {0.0, 1.0}, "share of edges that mean nothing");
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
      MakeCameraPoses(*CameraLayoutFromName(options.layout), options.num_images, 3.0, pose_rng);
  Rng cost_rng(seed, "view_graph_pairs");
  const PairCosts costs(poses, cost_rng);
  const std::vector<bool> chosen = ChoosePairs(costs, n, num_edges);

  Rng rng(seed, "view_graph_errors");
  const ErrorModel errors(options, rng);
  std::vector<char> is_outlier(num_edges, 0);
  std::fill_n(is_outlier.begin(), std::lround(options.outlier_ratio * num_edges), 1);
  rng.Shuffle(is_outlier);

  ViewGraphProblem problem;
  for (size_t i = 0; i < n; ++i) {
    problem.graph.image_ids.push_back(i + 1);
    problem.cam_from_world[i + 1] = poses[i];
    for (size_t j = i + 1; j < n; ++j) {
      if (!chosen[costs.Pair(i, j)]) continue;
      const Rigid3d exact = poses[j] * Inverse(poses[i]);
      ViewEdge edge;
      edge.image_id1 = i + 1;
      edge.image_id2 = j + 1;
      edge.cam2_from_cam1 = {exact.rotation, exact.translation.normalized()};
      const bool outlier = is_outlier[problem.graph.edges.size()];
      if (outlier) {
        edge.cam2_from_cam1 = {RandomRotation(rng), RandomDirection(rng)};
      } else {
        errors.Perturb(i, j, rng, &edge.cam2_from_cam1);
      }
      const double error = AngleBetween(exact.rotation, edge.cam2_from_cam1.rotation);
      edge.num_inliers = NumInliers(costs[costs.Pair(i, j)], error, outlier, rng);
      problem.graph.edges.push_back(edge);
      problem.is_outlier.push_back(outlier);
    }
  }
  problem.graph.Normalize();
  return problem;
}

}  // namespace cairn
