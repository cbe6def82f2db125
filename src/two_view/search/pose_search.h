#pragma once

#include <vector>

#include "cairn/base/rng.h"
#include "cairn/robust/pose_refinement.h"
#include "two_view/prepare/prepared_pair.h"
#include "two_view/search/guided_support.h"

namespace cairn::internal {

// Looks for the pose of a pair among rough hypotheses, wherever they come from: each is scored
// softly on a subset of the matches, the best are refined from a wide to the final threshold, and
// the search ends as soon as the evidence suffices: several independent hypotheses that converge to
// one model, or one that explains most matches (METHOD.md section 4).
class PoseSearch {
 public:
  explicit PoseSearch(const TwoViewOptions& options) : options_(options) {}

  // Begins with a pair that was ordered by consensus; it must outlive the search.
  void Reset(const PreparedPair& pair);

  // A hypothesis; rotation and translation of any one of its four poses will do.
  void Add(const Eigen::Matrix3d& E);
  // Refines the best hypotheses added since the last call, at most `max_num_refined`, until
  // HasConverged(); the others are forgotten.
  void RefineBest(int max_num_refined);
  // A pose that was refined at the threshold elsewhere.
  void AddRefined(const Rigid3d& pose);

  // Escapes local optima: rounds of five-point samples drawn from what the best model explains, the
  // best of which are refined on all matches and compared at the scale of the pair's noise, until
  // rounds bring nothing (the inner sampling of LO-RANSAC: Chum, Matas and Kittler, 2003).
  struct ResampleOptions {
    int num_samples = 10;  // a round
    int num_refined = 2;   // a round
    int patience = 2;      // rounds without gain before the end
    int max_num_rounds = 10;
  };
  // Spares no effort.
  static ResampleOptions ThoroughResampling(const TwoViewOptions& options) {
    return {.num_samples = options.num_resamples, .num_refined = 4, .patience = 4};
  }
  void Resample(const ResampleOptions& options, Rng* rng);

  bool HasModel() const { return best_score_ > 0.0; }
  bool HasConverged() const { return has_converged_; }
  // Enough support not to be chance.
  bool HasEvidence() const { return has_evidence_; }
  const Rigid3d& pose() const { return best_pose_; }  // refined at the threshold
  double score() const { return best_score_; }        // its MSAC support over all matches
  int64_t num_hypotheses() const { return num_hypotheses_; }

 private:
  struct Hypothesis {
    Eigen::Matrix3d E;
    double support;
  };

  struct Started {
    Rigid3d pose;
    double support;
  };

  int MoveBestToFront(int max_count);  // returns how many there are
  void Start(const Eigen::Matrix3d& E);
  void Finish(const Rigid3d& started);
  double MiddleScale() const;
  // What support of a pose is worth: the share of the matches that it explains in front of both
  // cameras, 1 where these are most of them.
  double WeightInFront(const Rigid3d& pose);
  Rigid3d RefineOnSubset(const Rigid3d& start, double scale, int max_iterations) const;
  Rigid3d RefineOnAll(const Rigid3d& start, int max_iterations) const;
  // Matches that the best model explains, and those that a model near it might.
  void FindReach();
  void SampleExplained(int num_samples, Rng* rng);

  TwoViewOptions options_;
  const PreparedPair* pair_ = nullptr;
  PointPairs subset_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<Started> started_;
  std::vector<float> errors_;
  std::vector<int32_t> explained_, reach_indices_;
  PointPairs reach_;
  GuidedSupport guided_;
  int64_t num_hypotheses_ = 0;

  Rigid3d best_pose_;
  Eigen::Matrix3d best_E_ = Eigen::Matrix3d::Zero();
  double best_score_ = 0.0;
  double best_subset_score_ = 0.0;
  int num_agreeing_ = 0;  // refined hypotheses that ended at the best model
  bool has_converged_ = false;
  bool has_evidence_ = false;
};

}  // namespace cairn::internal
