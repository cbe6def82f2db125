#include "cairn/bundle_adjustment/bundle_adjustment.h"

#include "bundle_adjustment/ceres_bundle.h"
#include "bundle_adjustment/check_bundle.h"
#include "bundle_adjustment/schur_bundle.h"
#include "cairn/base/named_value.h"
#include "cairn/base/timer.h"

namespace cairn {
void BundleAdjustmentOptions::VisitFields(OptionVisitor& v) {
  v.Choice("loss", loss, kReprojectionLosses, "robust loss on the reprojection error");
  v.Double("loss_scale", loss_scale, {1e-6, 1e6},
           "error at which the loss leaves the square, in standard deviations of the observation");
  v.Int("max_iterations", max_iterations, {0, 100000}, "iterations of one adjustment");
  v.Double("function_tolerance", function_tolerance, {0, 1},
           "stop when the cost changes relatively by less");
  v.Choice("solver", solver, kBundleSolvers,
           "auto: cairn's own, equal for any number of threads; the others: Ceres, and its solver");
}

std::string_view BundleAdjustmentStatusName(BundleAdjustmentStatus status) {
  using enum BundleAdjustmentStatus;
  constexpr NamedValue<BundleAdjustmentStatus> kNames[] = {{kConverged, "converged"},
                                                           {kMaxIterations, "max_iterations"},
                                                           {kNoObservations, "no_observations"},
                                                           {kFailed, "failed"},
                                                           {kStopped, "stopped"}};
  return NameOf(kNames, status);
}

BundleAdjustmentReport AdjustBundle(Reconstruction& reconstruction,
                                    const BundleAdjustmentScope& scope,
                                    const BundleAdjustmentOptions& options, const RunContext& run) {
  ValidateOptions(options, "bundle_adjustment");
  const Timer timer;
  if (std::string fault = CheckBundle(reconstruction, scope); !fault.empty()) {
    return {.status = BundleAdjustmentStatus::kFailed, .fault = std::move(fault)};
  }
  const bool is_ours = options.solver == BundleSolver::kAuto && SuitsSchurBundle(scope);
  BundleAdjustmentReport report = is_ours ? AdjustBySchurBundle(options, scope, run, reconstruction)
                                          : AdjustByCeres(options, scope, run, reconstruction);
  report.num_images = static_cast<int64_t>(reconstruction.images.size());
  report.seconds = timer.Seconds();
  return report;
}

}  // namespace cairn
