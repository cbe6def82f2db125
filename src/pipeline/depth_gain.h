#pragma once

#include <optional>

#include "cairn/pipeline/build_pipeline.h"

namespace cairn {

// Verifies a sample of the pairs whose images have depth with it and without, on one thread, as
// VerifyPairs did with this input and verifier. It takes a fiftieth of `budget_seconds`, or one
// pair. nullopt: no pair has depth.
std::optional<DepthGain> MeasureDepthGain(Database& database, const VerificationInput& input,
                                          const NamedVerifier& verifier, uint64_t seed,
                                          double budget_seconds);

}  // namespace cairn
