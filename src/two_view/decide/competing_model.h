#pragma once

#include <optional>

#include "two_view/search/pose_search.h"

namespace cairn::internal {

// Repeated structure gives a pair two models that explain about as many matches, each in its own
// part of them, and support alone does not tell which is right. Looks for a second model among the
// matches that the first one does not explain, where those that bear each other out are many. Where
// they are far more than those that it explains, it is one of many, whether or not one of the
// others stands out.
class CompetingModelSearch {
 public:
  explicit CompetingModelSearch(const TwoViewOptions& options)
      : options_(options), search_(options) {}

  // The matches of a second model that has at least options.min_competing_share of the first one's
  // support, or of many others; empty if there is none.
  FeatureMatches Find(const PairInput& input, const PreparedPair& pair, const Eigen::Matrix3d& E);

 private:
  // Fills rest_ with what E does not explain. False if that is too little to compete.
  bool CollectRest(const PreparedPair& pair, const Eigen::Matrix3d& E);

  bool IsOneOfMany() const;

  TwoViewOptions options_;
  PreparedPair rest_;
  PoseSearch search_;
  std::vector<float> errors_;
  std::vector<int32_t> indices_;
  int num_well_explained_ = 0;  // of the well supported matches
};

}  // namespace cairn::internal
