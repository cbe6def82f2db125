#include "cairn/two_view/pair_verifier.h"

#include <string>
#include <vector>

#include "cairn/base/named_value.h"
#include "two_view/focal_verifier.h"

namespace cairn {
namespace {

constexpr NamedValue<PairStatus> kPairStatuses[] = {
    {PairStatus::kVerified, "verified"},
    {PairStatus::kTooFewMatches, "too_few_matches"},
    {PairStatus::kNoDepth, "no_depth"},
    {PairStatus::kNoModel, "no_model"},
    {PairStatus::kTooFewInliers, "too_few_inliers"},
    {PairStatus::kDegenerate, "degenerate"},
};

constexpr NamedValue<VerifierKind> kVerifierKinds[] = {
    {VerifierKind::kCascade, "cascade"},         {VerifierKind::kFast, "fast"},
    {VerifierKind::kOneAcDepth, "one_ac_depth"}, {VerifierKind::kTwoAc, "two_ac"},
    {VerifierKind::kFivePoint, "five_point"},
};

}  // namespace

std::string_view PairStatusName(PairStatus status) { return NameOf(kPairStatuses, status); }

std::string_view VerifierKindName(VerifierKind kind) { return NameOf(kVerifierKinds, kind); }

VerifierKind VerifierKindFromName(std::string_view name) {
  std::vector<std::string> names;
  for (const auto& kind : kVerifierKinds) names.emplace_back(kind.name);
  CheckChoice("verifier", std::string(name), names);
  return *ValueOf(kVerifierKinds, name);
}

std::unique_ptr<PairVerifier> MakePairVerifier(VerifierKind kind, const TwoViewOptions& options) {
  ValidateOptions(options, "verification");
  VerifierKindFromName(VerifierKindName(kind));  // throws for a number that is none
  const bool is_cascade = kind == VerifierKind::kCascade;
  const bool is_five_point = kind == VerifierKind::kFivePoint;
  internal::SearchSteps steps;
  steps.name = VerifierKindName(kind);
  steps.one_ac_depth = kind != VerifierKind::kTwoAc && !is_five_point;
  steps.triangles = is_cascade;
  steps.two_ac = kind != VerifierKind::kOneAcDepth && !is_five_point;
  steps.five_point = is_cascade || is_five_point;
  steps.uses_votes = !is_five_point;
  // Single steps are there to be compared: nothing else finds a pair for them.
  const bool searches = kind != VerifierKind::kOneAcDepth && kind != VerifierKind::kTwoAc;
  return std::make_unique<internal::FocalVerifier>(steps, searches, options);
}

}  // namespace cairn
