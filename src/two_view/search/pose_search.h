#pragma once

#include <vector>

#include "two_view/prepare/prepared_pair.h"
#include "two_view/search/cheirality.h"

namespace cairn::internal {

// A pose that was refined at the threshold.
struct FoundPose {
  Rigid3d pose;
  Eigen::Matrix3d E = Eigen::Matrix3d::Zero();
  double score = 0.0;  // its MSAC support over all matches, weighed by Cheirality::WeightOf
};

// Models with this share of the best one's support may be as good as it, once they are refined.
inline constexpr double kEqualSupport = 0.8;
// Steps of a refinement at one scale.
inline constexpr int kNumSteps = 8;

// Refines a pose by a smooth loss, until a step gains less than a thousandth of it.
Rigid3d RefineSmoothly(const PointPairs& points, const Rigid3d& start, double scale_px,
                       int max_iterations);

// Looks for the pose of a pair among rough hypotheses, wherever they come from: each is scored
// softly on a subset of the matches, the best are refined from a wide to the final threshold, and
// the search ends as soon as the evidence suffices: several independent hypotheses that converge to
// one model, or one that explains most matches (src/two_view/README.md).
class PoseSearch {
 public:
  // Both must outlive the search.
  PoseSearch(const PreparedPair& pair, const TwoViewOptions& options);

  // A hypothesis; rotation and translation of any one of its four poses will do.
  void Add(const Eigen::Matrix3d& E);
  // Refines the best hypotheses added since the last call, at most `max_num_refined`, until
  // HasConverged(); the others are forgotten.
  void RefineBest(int max_num_refined);
  // A pose that was refined at the threshold elsewhere.
  void AddRefined(const Rigid3d& pose);

  bool HasModel() const { return best_.score > 0.0; }
  bool HasConverged() const { return has_converged_; }
  // Enough support not to be chance.
  bool HasEvidence() const { return has_evidence_; }
  const FoundPose& best() const { return best_; }
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

  Started Start(const Eigen::Matrix3d& E) const;
  void Finish(const Rigid3d& started);
  double RoughPx() const;
  double MiddlePx() const;  // between the rough scale and the threshold

  const PreparedPair& pair_;
  const TwoViewOptions& options_;
  Cheirality cheirality_;
  PointPairs subset_;  // on which hypotheses are ranked and roughly refined
  std::vector<Hypothesis> hypotheses_;
  int64_t num_hypotheses_ = 0;

  FoundPose best_;
  double best_subset_score_ = 0.0;
  int num_agreeing_ = 0;  // refined hypotheses that ended at the best model
  bool has_converged_ = false;
  bool has_evidence_ = false;
};

}  // namespace cairn::internal
