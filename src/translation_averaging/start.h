#pragma once

#include <optional>

#include "translation_averaging/direction_problem.h"
#include "translation_averaging/position_models.h"

namespace cairn {

// A deterministic start without a guess: least unsquared deviations (Ozyesil and Singer 2015),
//   min sum |x_2 - x_1 - l v|,  l >= 1,
// by ADMM on the scalar Laplacian of the graph with three right-hand sides. Over cameras alone
// where their edges connect them all, else over cameras and points.
// The number of threads does not change the result.
Positions LeastUnsquaredDeviations(const DirectionProblem& problem, int num_threads);

// Least absolute deviations from the lengths that edges have, relative to these, weighed by the
// points that tell them; nullopt where they do not join all cameras.
std::optional<Positions> StartByLengths(const DirectionProblem& problem, int num_threads);

// The point nearest to the rays of a track, for given cameras; where it lies behind a camera or
// rays are (nearly) parallel, a point far along the rays. `scale` is the size of the scene.
Eigen::Vector3d PointFromRays(std::span<const DirectionProblem::Ray> rays,
                              const Eigen::Matrix3Xd& cameras, double scale);

}  // namespace cairn
