#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "cairn/base/rng.h"
#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// Models of minimal samples, `count` of them, drawn among the matches at `indices`, each given to
// add(model).
template <class Solver, class Add>
void SampleModels(const PreparedPair& pair, std::span<const int32_t> indices, int count, Rng* rng,
                  const Add& add) {
  constexpr int kSampleSize = Solver::kSampleSize;
  const auto n = static_cast<uint32_t>(indices.size());
  if (n < kSampleSize) return;
  typename Solver::Model models[Solver::kMaxSolutions];
  for (int k = 0; k < count; ++k) {
    uint32_t sample[kSampleSize];
    rng->Sample(n, kSampleSize, sample);
    PointCorrespondence points[kSampleSize];
    for (int m = 0; m < kSampleSize; ++m) points[m] = pair.Points(indices[sample[m]]);
    const int num_models = Solver::Solve(points, models);
    for (int m = 0; m < num_models; ++m) add(models[m]);
  }
}

// Moves those of most support to the front, at most `max`; returns how many.
template <class Hypothesis>
int MoveBestToFront(int max, std::vector<Hypothesis>* hypotheses) {
  const auto count = std::min<ptrdiff_t>(max, std::ssize(*hypotheses));
  std::partial_sort(hypotheses->begin(), hypotheses->begin() + count, hypotheses->end(),
                    [](const Hypothesis& a, const Hypothesis& b) { return a.support > b.support; });
  return static_cast<int>(count);
}

struct ResamplingOptions {
  int num_samples = 10;  // a round
  int effort = 4;        // hypotheses that a round refines, and rounds without gain before the end
};

// Escapes local optima of the support of models (the inner sampling of LO-RANSAC: Chum, Matas and
// Kittler, 2003), until rounds bring nothing. A round of a `Neighborhood`:
//   double Begin();                   looks at what the best model explains; its support
//   int Sample(num_samples, max, rng) hypotheses from there, of which at most `max` are to be tried
//   double Try(k, best_support);      refines the k-th; where that is better it is the best model
//                                     from now on. The best support.
template <class Neighborhood>
void Resample(const ResamplingOptions& options, Rng* rng, Neighborhood* neighborhood) {
  constexpr double kGain = 1.005;  // of the support: less is no progress
  int num_stale_rounds = 0;
  while (num_stale_rounds < options.effort) {
    const double support_before = neighborhood->Begin();
    double best_support = support_before;
    const int count = neighborhood->Sample(options.num_samples, options.effort, rng);
    for (int k = 0; k < count; ++k) best_support = neighborhood->Try(k, best_support);
    // (Where nothing is supported, 0 is no gain over 0.)
    const bool gains = best_support > support_before && best_support >= kGain * support_before;
    num_stale_rounds = gains ? 0 : num_stale_rounds + 1;
  }
}

}  // namespace cairn::internal
