// Cui and Tan, "Global structure-from-motion by similarity averaging", ICCV 2015: how long one
// baseline is beside another, points tell that two pairs have in common; all lengths follow from
// these ratios. Directions alone leave the steps along a straight line open.

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "graph/graph.h"
#include "mapper/stages.h"
#include "sparse/laplacian_solver.h"

namespace cairn {
namespace {

// Rays that are nearer to parallel tell no depth.
constexpr double kMinParallaxDeg = 0.5;
// That two pairs have in common, to be compared.
constexpr size_t kMinSharedPoints = 10;
// Pairs of an image, those with the most points, that its others are compared with.
constexpr size_t kNumReferences = 10;
// Of least absolute errors by reweighted least squares; logarithms: a hundredth is one percent.
constexpr int kNumReweightings = 20;
constexpr double kLeastError = 0.01;
constexpr double kLeastChange = 0.001;
// More pairs are left to directions alone.
constexpr size_t kMostPairs = 20'000;

// The logarithm of the depth of a keypoint's point in baselines of a pair.
struct PointDepth {
  point2D_t keypoint;
  float log_depth;
};

// A pair, as one of its images sees it: its points by keypoint.
struct PairOfImage {
  int pair = 0;
  std::vector<PointDepth> depths;
};

// Of the keypoints of each image, along the world's axes; not a number where there is none.
using Rays = std::map<image_t, std::vector<Eigen::Vector3d>>;

Rays FindRays(const SceneData& scene, const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
              std::span<const DirectionEdge> directions, int num_threads) {
  Rays rays;
  for (const DirectionEdge& edge : directions) {
    rays[edge.image_id1];
    rays[edge.image_id2];
  }
  std::vector<Rays::value_type*> images;
  for (auto& entry : rays) images.push_back(&entry);
  ParallelFor(num_threads, std::ssize(images), [&](int64_t i) {
    const image_t id = images[i]->first;
    const Eigen::Quaterniond world_from_cam = cam_from_world.at(id).conjugate();
    const Camera& camera = scene.CameraOf(id);
    for (const Eigen::Vector2d& pixel : scene.pixels.at(id)) {
      const auto ray = camera.RayFromImg(pixel);
      images[i]->second.push_back(
          ray ? Eigen::Vector3d(world_from_cam * *ray)
              : Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
  });
  return rays;
}

// The points of a pair in each of its images: r1 l1 = d + r2 l2 for rays r and the direction d.
std::array<PairOfImage, 2> DepthsOf(const SceneData& scene, const Rays& rays, int pair,
                                    const DirectionEdge& edge) {
  const std::vector<Eigen::Vector3d>& rays1 = rays.at(edge.image_id1);
  const std::vector<Eigen::Vector3d>& rays2 = rays.at(edge.image_id2);
  const double min_squared_sine = std::pow(std::sin(DegToRad(kMinParallaxDeg)), 2);
  const Eigen::Vector3d direction = edge.direction.normalized();
  std::array<PairOfImage, 2> found = {PairOfImage{pair, {}}, PairOfImage{pair, {}}};
  for (const FeatureMatch& match :
       scene.matches.at(ImagePairToPairId(edge.image_id1, edge.image_id2))) {
    const Eigen::Vector3d &ray1 = rays1[match.point1], &ray2 = rays2[match.point2];
    const Eigen::Vector3d normal = ray1.cross(ray2);
    const double depth1 = direction.cross(ray2).dot(normal);
    const double depth2 = direction.cross(ray1).dot(normal);
    const double squared_sine = normal.squaredNorm();
    if (squared_sine < min_squared_sine || !(depth1 > 0) || !(depth2 > 0)) continue;
    found[0].depths.push_back({match.point1, static_cast<float>(std::log(depth1 / squared_sine))});
    found[1].depths.push_back({match.point2, static_cast<float>(std::log(depth2 / squared_sine))});
  }
  for (PairOfImage& each : found) std::ranges::sort(each.depths, {}, &PointDepth::keypoint);
  return found;
}

// The logarithm of how long pair2's baseline is beside pair1's.
struct Ratio {
  int pair1 = 0;
  int pair2 = 0;
  double log_ratio = 0;
  double num_points = 0;
};

std::optional<Ratio> RatioOf(const PairOfImage& a, const PairOfImage& b) {
  std::vector<double> differences;
  auto next = b.depths.begin();
  for (const PointDepth& point : a.depths) {
    while (next != b.depths.end() && next->keypoint < point.keypoint) ++next;
    if (next == b.depths.end()) break;
    if (next->keypoint == point.keypoint) {
      differences.push_back(point.log_depth - next->log_depth);
    }
  }
  if (differences.size() < kMinSharedPoints) return std::nullopt;
  const auto num_points = static_cast<double>(differences.size());
  return Ratio{a.pair, b.pair, UpperMedian(std::move(differences)), num_points};
}

// Of the pairs of one image.
std::vector<Ratio> RatiosOf(std::vector<const PairOfImage*> pairs) {
  std::ranges::stable_sort(pairs, std::greater<>(),
                           [](const PairOfImage* pair) { return pair->depths.size(); });
  std::vector<Ratio> ratios;
  for (size_t a = 0; a < std::min(pairs.size(), kNumReferences); ++a) {
    for (size_t b = a + 1; b < pairs.size(); ++b) {
      if (const auto ratio = RatioOf(*pairs[a], *pairs[b])) ratios.push_back(*ratio);
    }
  }
  return ratios;
}

// Of the pairs of all images.
std::vector<Ratio> FindRatios(std::span<const DirectionEdge> directions,
                              std::span<const std::array<PairOfImage, 2>> depths, int num_threads) {
  std::map<image_t, std::vector<const PairOfImage*>> pairs_of_image;
  for (size_t e = 0; e < directions.size(); ++e) {
    pairs_of_image[directions[e].image_id1].push_back(&depths[e][0]);
    pairs_of_image[directions[e].image_id2].push_back(&depths[e][1]);
  }
  std::vector<std::vector<const PairOfImage*>> images;
  for (auto& [id, pairs] : pairs_of_image) images.push_back(std::move(pairs));
  std::vector<std::vector<Ratio>> of_image(images.size());
  ParallelFor(num_threads, std::ssize(images),
              [&](int64_t i) { of_image[i] = RatiosOf(std::move(images[i])); });
  std::vector<Ratio> ratios;
  for (const auto& each : of_image) ratios.insert(ratios.end(), each.begin(), each.end());
  return ratios;
}

// The pairs of the largest set that ratios join.
std::vector<char> LargestSet(int num_pairs, std::span<const Ratio> ratios) {
  std::vector<GraphEdge> edges;
  for (const Ratio& ratio : ratios) edges.push_back({ratio.pair1, ratio.pair2});
  const GraphComponents sets = ConnectedComponents(num_pairs, edges);
  std::vector<char> is_in(num_pairs);
  for (int e = 0; e < num_pairs; ++e) is_in[e] = sets.component_of_node[e] == 0;
  return is_in;
}

// Logarithms of lengths with the least sum of absolute errors of the ratios; those of pairs that
// are not in the set mean nothing.
Eigen::VectorXd AverageRatios(std::span<const Ratio> ratios, const std::vector<char>& is_in,
                              int num_threads) {
  std::vector<char> is_gauge(is_in.size());
  for (size_t e = 0; e < is_in.size(); ++e) is_gauge[e] = !is_in[e];
  *std::ranges::find(is_gauge, 0) = 1;
  std::vector<GraphEdge> edges;
  std::vector<double> weights;
  for (const Ratio& ratio : ratios) {
    edges.push_back({ratio.pair1, ratio.pair2});
    weights.push_back(ratio.num_points);
  }
  LaplacianSolver solver(static_cast<int>(is_in.size()), edges, is_gauge, num_threads);
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(std::ssize(is_in), 1);
  for (int iteration = 0; iteration < kNumReweightings; ++iteration) {
    CAIRN_CHECK(solver.Factorize(weights));
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(std::ssize(is_in), 1);
    for (size_t i = 0; i < ratios.size(); ++i) {
      right(ratios[i].pair2, 0) += weights[i] * ratios[i].log_ratio;
      right(ratios[i].pair1, 0) -= weights[i] * ratios[i].log_ratio;
    }
    const Eigen::MatrixXd last = std::exchange(x, solver.Solve(right, x));
    if ((x - last).cwiseAbs().maxCoeff() < kLeastChange) break;
    for (size_t i = 0; i < ratios.size(); ++i) {
      const double error = x(ratios[i].pair2, 0) - x(ratios[i].pair1, 0) - ratios[i].log_ratio;
      weights[i] = ratios[i].num_points / std::max(std::abs(error), kLeastError);
    }
  }
  return x.col(0);
}

}  // namespace

void FindBaselineLengths(const StageContext& context,
                         const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
                         std::vector<DirectionEdge>& directions) {
  if (directions.size() > kMostPairs) return;
  const int num_threads = context.run.num_threads;
  const Rays rays = FindRays(context.scene, cam_from_world, directions, num_threads);
  std::vector<std::array<PairOfImage, 2>> depths(directions.size());
  ParallelFor(num_threads, std::ssize(directions), [&](int64_t e) {
    depths[e] = DepthsOf(context.scene, rays, static_cast<int>(e), directions[e]);
    directions[e].num_points = static_cast<int>(depths[e][0].depths.size());
  });
  const std::vector<Ratio> ratios = FindRatios(directions, depths, num_threads);
  if (ratios.empty()) return;
  const std::vector<char> is_in = LargestSet(static_cast<int>(directions.size()), ratios);
  const Eigen::VectorXd log_lengths = AverageRatios(ratios, is_in, num_threads);
  for (size_t e = 0; e < directions.size(); ++e) {
    if (is_in[e]) directions[e].length = std::exp(log_lengths[e]);
  }
}

}  // namespace cairn
