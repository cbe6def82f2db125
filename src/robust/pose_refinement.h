#pragma once

#include <span>

#include "cairn/geometry/rigid3d.h"
#include "robust/sampson_kernels.h"

namespace cairn {

struct PoseRefinementOptions {
  RobustLoss loss = RobustLoss::kTruncated;
  double scale_px = 1.0;
  int max_iterations = 25;
  double min_relative_gain = 1e-6;  // a step that gains less of the cost is the last
};

// Points that are refined together with others: their losses have a scale of their own, and this
// weight (a loss is at most 1).
struct WeightedPoints {
  const PointPairs* points;
  double scale_px = 1.0;
  double weight = 1.0;
};

// cam2_from_cam1 with |t| = 1: Levenberg-Marquardt over SO(3) x S2 on the robust Sampson error, no
// heap. `start` needs t != 0.
Rigid3d RefinePose(const PointPairs& points, const Rigid3d& start,
                   const PoseRefinementOptions& options);
// The same over several groups of points, each at its own scale (options.scale_px has no meaning).
Rigid3d RefinePose(std::span<const WeightedPoints> groups, const Rigid3d& start,
                   const PoseRefinementOptions& options);

// Largest standard deviations, radians, of a pose's rotation and of its direction of translation,
// for residuals of one pixel: by the Gauss-Newton hessian of the truncated loss. Not finite where
// no match is within scale_px.
struct PoseSigmas {
  double rotation = 0.0;
  double translation = 0.0;
};
PoseSigmas SigmasOfPose(const PointPairs& points, const Rigid3d& pose, double scale_px);

}  // namespace cairn
