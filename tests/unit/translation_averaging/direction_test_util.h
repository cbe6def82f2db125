#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "cairn/base/rng.h"
#include "cairn/evaluation/alignment.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/poses.h"
#include "cairn/translation_averaging/translation_averaging.h"
#include "math/random_vectors.h"

namespace cairn {

using Centers = std::map<image_t, Eigen::Vector3d>;

// Images 1 .. n at known centers, directions between some of them, and rays to scene points.
struct DirectionScene {
  Centers truth;
  std::vector<Eigen::Vector3d> true_points;
  std::vector<DirectionEdge> edges;
  std::vector<char> edge_is_wrong;
  std::vector<PointDirections> tracks;

  void AddCenters(const std::vector<Eigen::Vector3d>& centers) {
    for (const Eigen::Vector3d& c : centers) {
      const image_t id = static_cast<image_t>(truth.size()) + 1;
      truth[id] = c;
    }
  }
  void AddEdge(image_t a, image_t b, double noise_deg, double outlier_ratio, Rng& rng) {
    const bool is_wrong = rng.Uniform() < outlier_ratio;
    Eigen::Vector3d d = is_wrong ? RandomDirection(rng) : (truth[b] - truth[a]).normalized();
    d = Disturbed(d, noise_deg, rng);
    edges.push_back({a, b, d});
    edge_is_wrong.push_back(is_wrong);
  }
  // Every pair whose ids differ by at most `reach`.
  void AddChain(int reach, double noise_deg, double outlier_ratio, Rng& rng) {
    for (const auto& [a, ca] : truth) {
      for (const auto& [b, cb] : truth) {
        if (a < b && b <= a + reach) AddEdge(a, b, noise_deg, outlier_ratio, rng);
      }
    }
  }
  // Points near the cameras' middle ids a .. a + length - 1, seen by all of them.
  void AddPoints(int num_points, int length, double distance, double noise_deg,
                 double outlier_ratio, Rng& rng) {
    const int n = static_cast<int>(truth.size());
    for (int k = 0; k < num_points; ++k) {
      const int first = 1 + static_cast<int>(rng.UniformInt(n - std::min(n, length) + 1));
      const int last = std::min(n, first + length - 1);
      const Eigen::Vector3d direction = RandomDirection(rng);
      const Eigen::Vector3d X =
          truth[(first + last) / 2] + distance * rng.Uniform(0.6, 1.6) * direction;
      PointDirections track;
      for (int i = first; i <= last; ++i) {
        const bool is_wrong = rng.Uniform() < outlier_ratio;
        const Eigen::Vector3d d = is_wrong ? RandomDirection(rng) : (X - truth[i]).normalized();
        track.rays.push_back({static_cast<image_t>(i), Disturbed(d, noise_deg, rng)});
      }
      true_points.push_back(X);
      tracks.push_back(track);
    }
  }
  static Eigen::Vector3d Disturbed(const Eigen::Vector3d& d, double noise_deg, Rng& rng) {
    const Eigen::Vector3d w = GaussianVector<3>(rng);
    return ExpSO3(DegToRad(noise_deg) * w) * d;
  }
};

// The centers of the images that `a` has, in `a` and in `b`.
inline std::pair<std::vector<Eigen::Vector3d>, std::vector<Eigen::Vector3d>> Paired(
    const Centers& a, const Centers& b) {
  std::pair<std::vector<Eigen::Vector3d>, std::vector<Eigen::Vector3d>> pairs;
  for (const auto& [id, center] : a) {
    pairs.first.push_back(center);
    pairs.second.push_back(b.at(id));
  }
  return pairs;
}

// Distances to the truth after the best similarity, over the mean distance of the true centers from
// their mean; images without an estimate are left out.
inline std::vector<double> RelativeCenterErrors(const Centers& estimate, const Centers& truth) {
  const auto [a, b] = Paired(estimate, truth);
  const Sim3d b_from_a = AlignSimilarity(a, b).value();
  const Eigen::Map<const Eigen::Matrix3Xd> true_centers(b[0].data(), 3, b.size());
  const double extent =
      (true_centers.colwise() - true_centers.rowwise().mean()).colwise().norm().mean();
  std::vector<double> errors;
  for (size_t k = 0; k < a.size(); ++k) errors.push_back((b_from_a * a[k] - b[k]).norm() / extent);
  return errors;
}

inline double MaxError(const std::vector<double>& errors) {
  return *std::max_element(errors.begin(), errors.end());
}

}  // namespace cairn
