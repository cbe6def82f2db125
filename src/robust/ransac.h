#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>

#include "cairn/base/rng.h"

namespace cairn {

struct RansacOptions {
  double confidence = 0.99;
  int64_t min_iterations = 100;
  int64_t max_iterations = 10000;
  // Support that a model has to exceed: that of the best model known so far, from elsewhere.
  double initial_score = 0.0;
};

template <class Model>
struct RansacReport {
  // Absent: nothing exceeded the initial score, or there is less data than a sample needs.
  std::optional<Model> model;
  double score = 0.0;  // of the model
  int64_t num_iterations = 0;
};

// What RANSAC needs of an estimator. Scores are supports: larger is better.
template <class E>
concept RansacEstimator = requires(E e, const uint32_t* sample, typename E::Model* models,
                                   typename E::Model& model, double bound, int* num_inliers) {
  requires std::convertible_to<decltype(E::kSampleSize), int>;
  requires std::convertible_to<decltype(E::kMaxSolutions), int>;
  { e.NumData() } -> std::convertible_to<int>;
  // Models of the data at sample[0..kSampleSize); returns their number.
  { e.Solve(sample, models) } -> std::convertible_to<int>;
  // Support of a model; anything <= bound if it cannot exceed bound.
  { e.Score(model, bound) } -> std::convertible_to<double>;
  // Local optimization: improves the model and returns its support and number of inliers.
  { e.Optimize(model, num_inliers) } -> std::convertible_to<double>;
};

// Iterations after which a sample of `sample_size` inliers was drawn with the given confidence.
inline int64_t NumRansacIterations(double inlier_ratio, int sample_size, double confidence) {
  const double good = std::pow(std::clamp(inlier_ratio, 0.0, 1.0), sample_size);
  if (good >= 1.0) return 1;
  const double misses = std::log1p(-good);
  if (!(misses < 0.0)) return std::numeric_limits<int64_t>::max();
  const double n = std::ceil(std::log1p(-confidence) / misses);
  return n < 9e18 ? std::max<int64_t>(1, static_cast<int64_t>(n))
                  : std::numeric_limits<int64_t>::max();
}

// Locally optimized RANSAC (Chum, Matas and Kittler, 2003): every new best model is improved, and
// the improved one sets the bar. Result depends only on the estimator, the options and the state of
// rng.
template <RansacEstimator Estimator>
RansacReport<typename Estimator::Model> Ransac(Estimator& estimator, const RansacOptions& options,
                                               Rng& rng) {
  using Model = typename Estimator::Model;
  constexpr int kSampleSize = Estimator::kSampleSize;
  RansacReport<Model> report;
  const int num_data = estimator.NumData();
  if (num_data < kSampleSize) return report;
  report.score = options.initial_score;
  double best_minimal_score = options.initial_score;  // before local optimization
  int64_t num_needed = options.max_iterations;
  uint32_t sample[kSampleSize];
  Model models[Estimator::kMaxSolutions];
  while (report.num_iterations <
         std::min(options.max_iterations, std::max(options.min_iterations, num_needed))) {
    ++report.num_iterations;
    rng.Sample(static_cast<uint32_t>(num_data), kSampleSize, sample);
    const int num_models = estimator.Solve(sample, models);
    int best_index = -1;
    for (int i = 0; i < num_models; ++i) {
      const double score = estimator.Score(models[i], best_minimal_score);
      if (score > best_minimal_score) {
        best_minimal_score = score;
        best_index = i;
      }
    }
    if (best_index < 0) continue;
    Model model = models[best_index];
    int num_inliers = 0;
    const double score = estimator.Optimize(model, &num_inliers);
    if (!(score > report.score)) continue;
    report.score = score;
    report.model = model;
    num_needed = NumRansacIterations(static_cast<double>(num_inliers) / num_data, kSampleSize,
                                     options.confidence);
  }
  return report;
}

}  // namespace cairn
