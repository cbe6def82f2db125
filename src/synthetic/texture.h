#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace cairn {

// A solid texture (colour as a function of a point in the world) with detail at all scales from
// 0.8 down to 0.005 world units, nowhere repeating: sums of value noise over octaves, and bricks of
// random brightness.
class Texture {
 public:
  explicit Texture(uint64_t seed) : seed_(seed) {}

  // Colour in [0, 1], RGB, averaged over about `footprint` world units, so that detail too fine for
  // the image fades instead of aliasing. `material` picks the base colour.
  Eigen::Vector3f Color(const Eigen::Vector3d& point, int material, double footprint) const;

 private:
  uint64_t seed_;
};

// Smooth noise in [-1, 1] that varies over unit distances (value noise on the integer lattice).
float ValueNoise(uint64_t seed, const Eigen::Vector3d& point);

}  // namespace cairn
