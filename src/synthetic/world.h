#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "synthetic/texture.h"

namespace cairn {

// A half-line origin + t * direction, t > 0; the direction may have any length.
struct Ray {
  Eigen::Vector3d origin;
  Eigen::Vector3d direction;
};

struct Hit {
  double t = std::numeric_limits<double>::infinity();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // outward, length 1
  int material = 0;
  int solid = -1;  // index; -1: the ground
};

// A box or an upright cylinder, standing upright, turned around the vertical.
struct Solid {
  enum class Kind { kBox, kCylinder };
  Kind kind = Kind::kBox;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d half = Eigen::Vector3d::Ones();  // half extents; a cylinder: radius, -, height
  double angle = 0.0;                              // radians, around z
  int material = 0;

  double BoundingRadius() const;
  // The nearest hit in front, if it is nearer than *hit; then *hit is replaced.
  void Intersect(const Ray& ray, Hit* hit) const;
};

// A place with a building at the origin, about 1 in radius, with boxes on its walls, columns,
// things around it, and textured ground. Every seed gives another place.
class World {
 public:
  explicit World(uint64_t seed);

  // The nearest hit among the ground and the given solids (indices); absent: sky.
  std::optional<Hit> Cast(const Ray& ray, std::span<const int> solids) const;
  // Solids that rays from `origin` within `radius` (radians) of `axis` (length 1) may hit.
  std::vector<int> SolidsInCone(const Eigen::Vector3d& origin, const Eigen::Vector3d& axis,
                                double radius) const;
  // Colour of the surface that was hit, at `point` on it, with light from a fixed sun, averaged
  // over `footprint` world units.
  Eigen::Vector3f Shade(const Hit& hit, const Eigen::Vector3d& point, double footprint) const;
  Eigen::Vector3f SkyColor(const Eigen::Vector3d& direction) const;

  const std::vector<Solid>& solids() const { return solids_; }

 private:
  std::vector<Solid> solids_;
  Texture texture_;
};

}  // namespace cairn
