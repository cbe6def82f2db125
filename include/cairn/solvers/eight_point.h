#pragma once

#include <Eigen/Core>
#include <span>

#include "cairn/solvers/point_correspondence.h"

namespace cairn {

// Normalized eight-point algorithm (Hartley, "In defense of the eight-point algorithm", 1997) over
// eight or more correspondences. False if they are too few, or all at one place.
bool FundamentalFromEightPoints(std::span<const PointCorrespondence> samples, Eigen::Matrix3d* F);

}  // namespace cairn
