#pragma once

#include <Eigen/Core>

#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// Where most of what F explains lies near one plane, many fundamental matrices explain nearly as
// much, and each is a local optimum. Rounds of samples (resampling.h) look for a better one: seven
// points of those that F explains, and two points off the plane that dominates these, which with
// its homography give F = [e] H (plane and parallax: Chum, Werner and Matas, "Two-view geometry
// estimation unaffected by a dominant plane", CVPR 2005). The best are refined at the
// threshold and compared at the scale of the pair's noise. One that no plausible focal lengths make
// an essential matrix counts half. F of normalized points, and so the result, refined at the scale
// of the noise.
Eigen::Matrix3d ResampleFundamental(const PreparedPair& pair, const Eigen::Matrix3d& start);

}  // namespace cairn::internal
