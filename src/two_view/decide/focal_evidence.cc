#include "two_view/decide/focal_evidence.h"

#include <algorithm>
#include <numeric>

#include "robust/match_errors.h"
#include "two_view/decide/focal_plausibility.h"
#include "two_view/search/fundamental_search.h"

namespace cairn::internal {
namespace {

// What right and wrong focal lengths are told apart by, thresholds: an essential matrix of wrong
// ones stays near to many matches.
constexpr double kSharp = 0.5;

}  // namespace

std::optional<FocalEvidence> WeighFocals(const PreparedPair& pair, const Eigen::Matrix3d& E,
                                         const TwoViewOptions& options) {
  const int min_matches = 2 * options.min_num_matches;
  FocalEvidence evidence;
  evidence.num_matches = std::min(pair.NumSupported(), kEnoughMatches);
  if (!pair.IsSupported() || evidence.num_matches < min_matches) return std::nullopt;
  std::vector<int32_t> first(evidence.num_matches);
  std::iota(first.begin(), first.end(), 0);
  const PreparedPair supported = pair.Subset(first);
  const double max_error_px = kSharp * supported.max_error_px;
  evidence.num_by_essential = MatchErrors(supported.points, E).CountBelow(max_error_px);
  evidence.num_by_fundamental = evidence.num_by_essential;
  // (An F that no plausible focal lengths give is of repeated structure, and says nothing of them.)
  const auto model = FindFundamental(supported, {.confidence = options.confidence,
                                                 .min_iterations = 1,
                                                 .max_iterations = options.min_iterations});
  if (model && HasPlausibleFocals(model->F, *pair.input.camera1, *pair.input.camera2)) {
    evidence.num_by_fundamental =
        std::max(evidence.num_by_essential,
                 MatchErrors(supported.points, model->F).CountBelow(max_error_px));
  }
  return evidence;
}

}  // namespace cairn::internal
