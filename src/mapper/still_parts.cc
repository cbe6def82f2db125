#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>

#include "cairn/base/parallel.h"
#include "mapper/stages.h"
#include "math/log_binomial.h"

namespace cairn {
namespace {

int CountStill(const SceneData& scene, const ViewEdge& edge, const FeatureMatches& matches) {
  const double max_error_px =
      DefaultMaxErrorPx(scene.CameraOf(edge.image_id1), scene.CameraOf(edge.image_id2));
  const std::vector<Eigen::Vector2d>& pixels1 = scene.pixels.at(edge.image_id1);
  const std::vector<Eigen::Vector2d>& pixels2 = scene.pixels.at(edge.image_id2);
  return static_cast<int>(std::ranges::count_if(matches, [&](const FeatureMatch& match) {
    return (pixels1[match.point1] - pixels2[match.point2]).norm() <= max_error_px;
  }));
}

// A pair stays still as a whole if its geometry does (matches of such are not kept), or most of its
// inliers do.
bool Moves(const SceneData& scene, const ViewEdge& edge) {
  const FeatureMatches& inliers = scene.matches.at(edge.PairId());
  return 2 * CountStill(scene, edge, inliers) < static_cast<int>(inliers.size());
}

// That are looked at. (One pair may be of two turns of a turntable at the same angle, between which
// all moves alike.)
constexpr size_t kPairsOfAnImage = 5;

// What an image's verified pairs show.
struct ImageMotion {
  int num_pairs = 0;
  int num_still = 0;
  std::vector<const ViewEdge*> best;  // of those that move, the ones with the most inliers

  // Photographs of a video may stay still against the next ones, but not against most.
  bool IsStill() const { return 2 * num_still > num_pairs; }
};

std::map<image_t, ImageMotion> ImageMotions(const SceneData& scene, int num_threads) {
  std::vector<char> edge_moves(scene.edges.size());
  ParallelFor(
      num_threads, std::ssize(scene.edges),
      [&](int64_t e) {
        edge_moves[e] = scene.edges[e].num_inliers > 0 && Moves(scene, scene.edges[e]);
      },
      /*grain=*/64);
  std::map<image_t, ImageMotion> motions;
  for (size_t e = 0; e < scene.edges.size(); ++e) {
    const ViewEdge& edge = scene.edges[e];
    if (edge.num_inliers == 0) continue;
    const bool moves = edge_moves[e];
    for (const image_t id : {edge.image_id1, edge.image_id2}) {
      ImageMotion& motion = motions[id];
      ++motion.num_pairs;
      motion.num_still += !moves;
      if (moves) motion.best.push_back(&edge);
    }
  }
  for (auto& [id, motion] : motions) {
    std::ranges::stable_sort(motion.best, std::greater<>(), &ViewEdge::num_inliers);
    motion.best.resize(std::min(motion.best.size(), kPairsOfAnImage));
  }
  return motions;
}

// Natural logarithm of a bound of the chance of k or more successes in n trials, k > n * chance
// (Feller, "An introduction to probability theory and its applications", volume 1, VI.3.5).
double LogTail(int k, int n, double chance) {
  return LogBinomial(n, k) + k * std::log(chance) + (n - k) * std::log(1 - chance) +
         std::log((k + 1) * (1 - chance) / (k + 1 - (n + 1) * chance));
}

// How many matches of a pair that moves are still for another reason than its geometry. Inliers
// tell how often what moves happens to be still (Laplace's rule of succession). So many rejected
// ones are to be expected in less than one of num_tests pairs, or the result is 0 (a contrario;
// Desolneux, Moisan and Morel, "Meaningful alignments", 2000). One match is no part of a picture.
int CountStrangers(const SceneData& scene, const ViewEdge& edge, size_t num_tests) {
  const FeatureMatches& inliers = scene.matches.at(edge.PairId());
  const FeatureMatches all = scene.raw_matches(edge);
  FeatureMatches rejected;
  std::set_difference(all.begin(), all.end(), inliers.begin(), inliers.end(),
                      std::back_inserter(rejected));
  const int n = static_cast<int>(rejected.size());
  const int k = CountStill(scene, edge, rejected);
  const double chance =
      (CountStill(scene, edge, inliers) + 1.0) / (static_cast<double>(inliers.size()) + 2.0);
  if (k < 2 || k <= n * chance) return 0;
  return std::log(static_cast<double>(num_tests)) + LogTail(k, n, chance) < 0 ? k : 0;
}

}  // namespace

std::optional<ResultWarning> FindStillParts(const SceneData& scene, int num_threads) {
  const std::map<image_t, ImageMotion> motions = ImageMotions(scene, num_threads);
  std::map<image_pair_t, int> num_strangers;
  size_t num_still = 0, num_partly = 0;
  int most = 0;
  std::string example;
  for (const auto& [id, motion] : motions) {
    num_still += motion.IsStill();
    if (motion.IsStill()) continue;
    bool is_partly_still = false;
    for (const ViewEdge* edge : motion.best) {
      const auto [known, is_new] = num_strangers.try_emplace(edge->PairId());
      if (is_new) {
        known->second = CountStrangers(scene, *edge, kPairsOfAnImage * motions.size());
      }
      is_partly_still |= known->second > 0;
      if (known->second <= most) continue;
      most = known->second;
      example = " (" + std::to_string(most) + " matches of " +
                scene.images.at(edge->image_id1).name + " and " +
                scene.images.at(edge->image_id2).name + ", and others)";
    }
    num_partly += is_partly_still;
  }
  if (2 * (num_still + num_partly) <= motions.size()) return std::nullopt;
  const std::string photos = " of " + std::to_string(motions.size()) + " photos";
  return ResultWarning{
      (num_partly > num_still ? "parts of the picture stay still while others move, in " +
                                    std::to_string(num_partly) + photos + example
                              : "what most pairs of photos share stays still in the picture (" +
                                    std::to_string(num_still) + photos + ")") +
          ", maybe a background that does not turn with the object",
      "leave out by masks (--mask_path of build_view_graph) what does not turn, or lies over the "
      "photos; if the camera did not move, add photos from other places"};
}

}  // namespace cairn
