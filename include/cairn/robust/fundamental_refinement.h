#pragma once

#include "cairn/robust/sampson_kernels.h"

namespace cairn {

struct FundamentalRefinementOptions {
  double scale_px = 1.0;
  int max_iterations = 25;
  // Stops when a step is shorter than this, or gains less than this share of the cost.
  double min_step = 1e-8;
  double min_relative_gain = 1e-5;
};

struct FundamentalRefinementReport {
  Eigen::Matrix3d F;  // of rank 2, |F| = 1
  double cost = 0.0;  // sum of losses, each at most 1
  int num_iterations = 0;
};

// Levenberg-Marquardt on the Geman-McClure loss of the Sampson error over the seven parameters of
// F = U diag(cos s, sin s, 0) V^T (Bartoli and Sturm, "Nonlinear estimation of the fundamental
// matrix with minimal parameters", PAMI 2004). F of normalized points, as the errors of
// sampson_kernels.h. Any start but zero will do; its third singular value is dropped. About 0.1
// microseconds a correspondence and iteration.
FundamentalRefinementReport RefineFundamentalMatrix(const PointPairs& points,
                                                    const Eigen::Matrix3d& start,
                                                    const FundamentalRefinementOptions& options);

}  // namespace cairn
