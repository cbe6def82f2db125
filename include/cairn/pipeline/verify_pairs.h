#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/pipeline/stages.h"
#include "cairn/two_view/options.h"
#include "cairn/two_view/pair_verifier.h"

namespace cairn {

// A verifier that the scheduler runs on every pair; `make` is called once a thread.
struct NamedVerifier {
  std::string name;
  std::function<std::unique_ptr<PairVerifier>()> make;
};

struct VerificationInput {
  // Which pairs, beside those that our matching stage matched; nullopt: all that have matches.
  std::optional<std::vector<image_pair_t>> pairs;
  // Pairs with fewer matches are not tried.
  int min_num_matches = 20;
  // "key = value" lines of everything that the verifiers' results depend on, for the stage's
  // record.
  std::string options;
  SchedulerOptions scheduler;
};

// Verifies every pair with matches that has no row in two_view_geometries.
// Each verifier runs on each pair independently; its outcome is a row of cairn_pair_metrics, its
// time one of cairn_timings; the verified one with the largest score becomes the pair's row in
// two_view_geometries (of equal ones the earlier in `verifiers`). A pair that no verifier accepts,
// or that was not tried, gets an empty row, as from COLMAP.
//
// Likely pairs come first, in a round of their own (pipeline/pairs/plan.h), after which it
// is learned and stored what lenses unknown cameras have (intrinsics/lens_learning.h), and which
// trusted focal lengths are wrong (intrinsics/focal_learning.h; the pairs of these cameras are
// verified again, with what was learned). Within a round, pairs are ordered so that
// features are read once a block and stay within the memory limit; one
// thread reads ahead, one writes. What a pair yields depends on its own features, depth, cameras,
// matches, the options, the seed and what the first round learned, and on nothing else. Pairs that
// are done are not done again; if their inputs have changed, ConfigError names the pair. Pairs with
// a row that cannot be read are left out, with one Warning a row.
//
// Values of the report: of the pairs that this run worked on, "pairs", "tried" (those with enough
// matches), "verified", "verified_by_<verifier>", "rejected_<reason>"; cameras of which it learned
// a lens ("learned_lenses"), or that a trusted focal length is wrong ("rejected_focals"); and
// "learning_seconds".
StageReport VerifyPairs(Database& database, const std::vector<NamedVerifier>& verifiers,
                        const VerificationInput& input, const RunContext& run = {},
                        Helpers* helpers = nullptr);

// The verifiers of --verifier, in the order of precedence. Throws ConfigError.
std::vector<NamedVerifier> MakeVerifiers(const std::string& choice, const TwoViewOptions& options);

}  // namespace cairn
