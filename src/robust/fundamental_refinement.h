#pragma once

#include "math/normal_equations.h"
#include "robust/fundamental_factors.h"
#include "robust/point_pairs.h"

namespace cairn {

struct FundamentalRefinementOptions {
  double scale_px = 1.0;
  int max_iterations = 25;
  double min_relative_gain = 1e-5;  // a step that gains less of the cost is the last
};

// Levenberg-Marquardt on the Geman-McClure loss e^2 / (s^2 + e^2) of the Sampson error e over the
// seven dimensions of F. F of normalized points, as the errors of sampson_kernels.h. Any start but
// zero will do; its third singular value is dropped. About 0.1 microseconds a correspondence and
// iteration.
FundamentalFactors RefineFundamentalMatrix(const PointPairs& points, const Eigen::Matrix3d& start,
                                           const FundamentalRefinementOptions& options);

// The normal equations of these losses over F's nine elements (columns one after the other), of
// every `step`th correspondence from `begin` on.
NormalEquations<9> LinearizeFundamental(const PointPairs& points, const Eigen::Matrix3d& F,
                                        double scale_px, int begin = 0, int step = 1);

}  // namespace cairn
