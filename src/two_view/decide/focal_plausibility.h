#pragma once

#include <Eigen/Core>

#include "cairn/camera/camera.h"

namespace cairn::internal {

// Could F of normalized points be an essential matrix at other focal lengths? A fundamental matrix
// of a plane and of wrong matches that follow each other (a row of windows, matched one too far)
// mostly could not, at any plausible focal lengths, while right ones
// can; so this tells them apart where support cannot. One camera: both images have one focal
// length. The two singular values may differ by 5 %. Plausible are kShortestFocal to kLongestFocal,
// which covers 0.4 to 6 widths of upright and of wide images; for a trusted camera, 0.4 to 2.5
// times what is given. A microsecond or two.
bool HasPlausibleFocals(const Eigen::Matrix3d& F, const Camera& camera1, const Camera& camera2);

}  // namespace cairn::internal
