#include "cairn/two_view/pair_verifier.h"

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "two_view/focal_verifier.h"

namespace cairn {

std::string_view PairStatusName(PairStatus status) {
  switch (status) {
    case PairStatus::kVerified:
      return "verified";
    case PairStatus::kTooFewMatches:
      return "too_few_matches";
    case PairStatus::kNoDepth:
      return "no_depth";
    case PairStatus::kNoModel:
      return "no_model";
    case PairStatus::kTooFewInliers:
      return "too_few_inliers";
    case PairStatus::kDegenerate:
      return "degenerate";
  }
  return "unknown";
}

std::string_view VerifierKindName(VerifierKind kind) {
  switch (kind) {
    case VerifierKind::kCascade:
      return "cascade";
    case VerifierKind::kFast:
      return "fast";
    case VerifierKind::kOneAcDepth:
      return "one_ac_depth";
    case VerifierKind::kTwoAc:
      return "two_ac";
    case VerifierKind::kFivePoint:
      return "five_point";
  }
  return "unknown";
}

VerifierKind VerifierKindFromName(std::string_view name) {
  for (const VerifierKind kind :
       {VerifierKind::kCascade, VerifierKind::kFast, VerifierKind::kOneAcDepth,
        VerifierKind::kTwoAc, VerifierKind::kFivePoint}) {
    if (name == VerifierKindName(kind)) return kind;
  }
  throw ConfigError("verifier", "unknown name '" + std::string(name) + "'");
}

std::unique_ptr<PairVerifier> MakePairVerifier(VerifierKind kind, const TwoViewOptions& options) {
  ValidateOptions(options, "verification");
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
