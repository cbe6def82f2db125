#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/geometry/rigid3d.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// Similarities to axes x, y, z by places whose z is not known. Points on a plane are in the same
// places, seen along z, when the plane tilts the other way: there are two answers then, which
// differ by more than a shift along z.

// Nearly half of the points may be wrong: least median of horizontal residuals over triples of
// points, each of which has two answers. nullopt: no triple is off a line.
std::optional<Sim3d> AlignHorizontallyRobust(const std::vector<Eigen::Vector3d>& src,
                                             const std::vector<Eigen::Vector3d>& dst,
                                             uint64_t seed);

// From a start on, minimizes the sum of squared horizontal residuals, each with its weight. The
// points' weighted mean has z = 0.
Sim3d AlignHorizontally(const std::vector<Eigen::Vector3d>& src,
                        const std::vector<Eigen::Vector3d>& dst, const std::vector<double>& weights,
                        Sim3d dst_from_src);

// How far photographs are from being held level, upright or on edge: the mean squared sine of the
// angle between the horizontal plane and the side that is nearest to it.
double OffLevel(const Reconstruction& model, const Eigen::Quaterniond& enu_from_world);

}  // namespace cairn
