#pragma once

#include "cairn/base/run_context.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"

namespace cairn {

// Bundle adjustment by Ceres, of any scope. With several threads the order of its sums, and so the
// last digits, differ from run to run. The rest of the report is the caller's.
BundleAdjustmentReport AdjustByCeres(const BundleAdjustmentOptions& options,
                                     const BundleAdjustmentScope& scope, const RunContext& run,
                                     Reconstruction& reconstruction);

}  // namespace cairn
