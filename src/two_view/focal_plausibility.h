#pragma once

#include <Eigen/Core>

namespace cairn::internal {

// Could F of normalized points be an essential matrix at other focal lengths? A fundamental matrix
// of a plane and of wrong matches that follow each other (a row of windows, matched one too far)
// mostly could not, at any focal lengths between 0.4 and 2.5 times the given ones, while right ones
// can; so this tells them apart where support cannot. One camera: both images have one focal
// length. The two singular values may differ by 5 %. About a microsecond.
bool HasPlausibleFocals(const Eigen::Matrix3d& F, bool one_camera);

}  // namespace cairn::internal
