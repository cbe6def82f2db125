#include "two_view/focal_evidence.h"

#include <algorithm>

#include "cairn/robust/sampson_kernels.h"
#include "two_view/focal_plausibility.h"
#include "two_view/fundamental_search.h"

namespace cairn::internal {
namespace {

constexpr int kMinMatches = 40, kMaxMatches = 192;
constexpr int kMaxEvidenceSamples = 100;

}  // namespace

FocalWeigher::FocalWeigher(const TwoViewOptions& options) : options_(options) {
  options_.min_iterations = 1;
  options_.max_fallback_samples = kMaxEvidenceSamples;
}

std::optional<FocalEvidence> FocalWeigher::Weigh(const PairInput& input, const PreparedPair& pair,
                                                 const Eigen::Matrix3d& E) {
  FocalEvidence evidence;
  evidence.num_matches = std::min(pair.NumSupported(), kMaxMatches);
  if (!pair.IsSupported() || evidence.num_matches < kMinMatches) return std::nullopt;
  supported_.points.SetPrefix(pair.points, evidence.num_matches);
  supported_.vote_class_end.fill(evidence.num_matches);
  supported_.consensus_sigmas = pair.consensus_sigmas;
  supported_.max_error_px = pair.max_error_px;
  supported_.chance_per_px = pair.chance_per_px;

  errors_.resize(supported_.points.num_blocks() * PointPairs::kBlock);
  SampsonErrors(supported_.points, E, errors_.data());
  evidence.num_by_essential =
      static_cast<int>(std::count_if(errors_.begin(), errors_.begin() + evidence.num_matches,
                                     [&](float error) { return error < pair.max_error_px; }));
  evidence.num_by_fundamental = evidence.num_by_essential;
  // (An F that no plausible focal lengths give is of repeated structure, and says nothing of them.)
  const auto model = FindFundamental(input, supported_, options_);
  if (model && HasPlausibleFocals(model->F, *input.camera1, *input.camera2)) {
    evidence.num_by_fundamental =
        std::max(evidence.num_by_essential, static_cast<int>(model->inliers.size()));
  }
  return evidence;
}

}  // namespace cairn::internal
