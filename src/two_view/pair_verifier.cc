#include "cairn/two_view/pair_verifier.h"

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "two_view/five_point_verifier.h"
#include "two_view/one_ac_depth_verifier.h"

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
    case VerifierKind::kOneAcDepth:
      return "one_ac_depth";
    case VerifierKind::kFivePoint:
      return "five_point";
  }
  return "unknown";
}

VerifierKind VerifierKindFromName(std::string_view name) {
  for (const VerifierKind kind : {VerifierKind::kOneAcDepth, VerifierKind::kFivePoint}) {
    if (name == VerifierKindName(kind)) return kind;
  }
  throw ConfigError("verifier", "unknown name '" + std::string(name) + "'");
}

std::unique_ptr<PairVerifier> MakePairVerifier(VerifierKind kind, const TwoViewOptions& options) {
  ValidateOptions(options, "verification");
  switch (kind) {
    case VerifierKind::kOneAcDepth:
      return std::make_unique<internal::OneAcDepthVerifier>(options);
    case VerifierKind::kFivePoint:
      return std::make_unique<internal::FivePointVerifier>(options);
  }
  CAIRN_CHECK(false);
  return nullptr;
}

}  // namespace cairn
