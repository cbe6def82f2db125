#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/two_view/pair_verifier.h"
#include "robust/point_pairs.h"

namespace cairn::experiments {

// The paper's comparison on real pairs: two minimal solvers in one and the same robust estimator,
// LO-RANSAC with MSAC over the Sampson error, the number of iterations by the confidence and the
// share of inliers, and one local optimization for both (nonlinear, with a shrinking scale). The
// paper has GC-RANSAC with eight points as local optimization, and its default values, of which the
// fewest iterations matter here.
struct PaperEstimatorOptions {
  double confidence = 0.99;
  double max_error_over_diagonal = 0.0005;  // threshold, as a share of the mean image diagonal
  int64_t min_iterations = 20;
  int64_t max_iterations = 10000;
};

struct PaperEstimate {
  std::optional<Rigid3d> cam2_from_cam1;  // |t| = 1
  int num_inliers = 0;
  int64_t num_iterations = 0;
};

enum class MinimalSolver { kFivePoint, kOneAffineDepth };

PaperEstimate EstimateAsPaper(const PairInput& input, MinimalSolver solver,
                              const PaperEstimatorOptions& options);

// The threshold in pixels.
double PaperThresholdPx(const PairInput& input, const PaperEstimatorOptions& options);

// What both solvers work on: the matches in normalized coordinates.
class NormalizedMatches {
 public:
  explicit NormalizedMatches(const PairInput& input);
  const PointPairs& points() const { return points_; }
  // By 1AC+D from match i of points(); absent without depth, or if the solver rejects the sample.
  std::optional<Rigid3d> PoseFromOne(int i) const;
  int size() const { return points_.size(); }
  // Matches of the pair, those included that the camera model cannot express.
  int num_matches() const { return static_cast<int>(input_.matches.size()); }

 private:
  const PairInput input_;
  PointPairs points_;
  std::vector<int> match_index_;
};

}  // namespace cairn::experiments
