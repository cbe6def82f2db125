#pragma once

#include <Eigen/Core>
#include <array>

#include "cairn/base/rng.h"
#include "cairn/synthetic/surface.h"

namespace cairn {

// The smooth surface of abstract scenes: a sum of waves h(u, v), 2 pi-periodic in u, |h| <= 1.
class Relief {
 public:
  explicit Relief(Rng& rng);
  // h and its derivatives.
  double Value(double u, double v, Eigen::Vector2d* gradient) const;

 private:
  struct Wave {
    double amplitude, u, v, phase;
  };
  std::array<Wave, 6> waves_;
};

// Points of a wall of the given half length and height 1.5 in the plane y = 0, its front towards
// negative y.
SurfaceElement SampleWall(const Relief& relief, double amplitude, double half_length, double size,
                          Rng& rng);
// Points of a tower of radius about 0.8 and height 1.5 around the z axis.
SurfaceElement SampleTower(const Relief& relief, double amplitude, double size, Rng& rng);

}  // namespace cairn
