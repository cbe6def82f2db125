#pragma once

#include <Eigen/Geometry>
#include <span>

namespace cairn {

// A rotation that one edge proposes for its camera, or for its group of cameras.
struct Vote {
  Eigen::Quaterniond rotation;
  double trust = 0;
};

// Support of a rotation: sum of trust / (1 + (angle / sigma)^2), sigma in radians.
double Support(const Eigen::Quaterniond& rotation, std::span<const Vote> votes, double sigma);

// The vote with the most support; of many votes 32, evenly spread, are tried. Not of an empty span.
struct Mode {
  Eigen::Quaterniond rotation;
  double support = 0;
};
Mode FindMode(std::span<const Vote> votes, double sigma);

}  // namespace cairn
