#include "two_view/search/pose_resampling.h"

#include <algorithm>

#include "cairn/geometry/epipolar.h"
#include "cairn/solvers/five_point.h"
#include "robust/match_errors.h"
#include "two_view/search/guided_support.h"

namespace cairn::internal {
namespace {

// Poses near the best one.
class PoseNeighborhood {
 public:
  PoseNeighborhood(const PreparedPair& pair, const FoundPose& start)
      : pair_(pair), best_(start), cheirality_(pair) {}

  double Begin() {
    errors_.SetSampson(pair_.points, best_.E);
    explained_ = errors_.Below(pair_.max_error_px);
    const std::vector<int32_t> near = errors_.Below(kReach * pair_.max_error_px);
    reach_.SetSubset(pair_.points, near.data(), static_cast<int>(near.size()));
    // Models near each other differ in how closely they fit, which only the noise's own scale
    // tells.
    guided_.Learn(pair_, errors_.values(), kReach * pair_.max_error_px);
    return guided_.Score(best_.E) * cheirality_.Choose(best_.pose, explained_).share;
  }

  int Sample(int num_samples, int max_count, Rng* rng) {
    hypotheses_.clear();
    double best_score = 0.0;
    SampleModels<FivePoint>(pair_, explained_, num_samples, rng, [&](const Eigen::Matrix3d& E) {
      ++num_hypotheses;
      // Models of right matches far apart are good: all matches that matter, at the final
      // threshold, tell them apart.
      const double score = ScoreSampson(reach_, E, pair_.max_error_px, kEqualSupport * best_score);
      if (score < 0.0) return;
      best_score = std::max(best_score, score);
      hypotheses_.push_back({E, score});
    });
    return MoveBestToFront(max_count, &hypotheses_);
  }

  double Try(int k, double best_support) {
    const Rigid3d start = PosesFromEssential(hypotheses_[k].E)[0];
    const Rigid3d pose = RefineSmoothly(reach_, start, guided_.scale_px(), kNumSteps);
    const Eigen::Matrix3d E = EssentialFromPose(pose);
    double support = guided_.Score(E);
    if (!(support > best_support)) return best_support;
    support *= cheirality_.WeightOf(pose);
    if (!(support > best_support)) return best_support;
    const double score = ScoreSampson(pair_.points, E, pair_.max_error_px);
    if (score < kEqualSupport * best_.score) return best_support;
    best_ = {pose, E, std::max(best_.score, score)};
    return support;
  }

  const Rigid3d& Best() const { return best_.pose; }

  int64_t num_hypotheses = 0;

 private:
  struct Hypothesis {
    Eigen::Matrix3d E;
    double support;
  };

  const PreparedPair& pair_;
  FoundPose best_;  // its score: the largest of all so far
  Cheirality cheirality_;
  MatchErrors errors_;
  std::vector<int32_t> explained_;
  PointPairs reach_;
  GuidedSupport guided_;
  std::vector<Hypothesis> hypotheses_;
};

}  // namespace

Rigid3d ResamplePose(const PreparedPair& pair, const FoundPose& start,
                     const ResamplingOptions& options, int64_t* num_hypotheses) {
  PoseNeighborhood neighborhood(pair, start);
  Rng rng(pair.input.seed, "resample", pair.input.pair_id);
  Resample(options, &rng, &neighborhood);
  *num_hypotheses += neighborhood.num_hypotheses;
  return neighborhood.Best();
}

}  // namespace cairn::internal
