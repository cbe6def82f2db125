#include "synthetic/world.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "cairn/base/rng.h"
#include "math/random_vectors.h"

namespace cairn {
namespace {

constexpr double kGroundHeight = -0.75;
constexpr double kGroundRadius = 15.0;
constexpr int kGroundMaterial = 3;
constexpr double kNearest = 1e-9;

Eigen::Vector3d RotatedZ(const Eigen::Vector3d& v, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * v.x() - s * v.y(), s * v.x() + c * v.y(), v.z()};
}

// Slabs (Kay and Kajiya 1986), in the box's frame.
void IntersectBox(const Ray& ray, const Eigen::Vector3d& half, double* t, Eigen::Vector3d* normal) {
  const auto& [o, d] = ray;
  double near = -std::numeric_limits<double>::infinity();
  double far = std::numeric_limits<double>::infinity();
  int axis = 0;
  for (int k = 0; k < 3; ++k) {
    if (d[k] == 0.0) {
      if (std::abs(o[k]) > half[k]) return;
      continue;
    }
    const double center = -o[k] / d[k];
    const double reach = half[k] / std::abs(d[k]);
    if (center - reach > near) {
      near = center - reach;
      axis = k;
    }
    far = std::min(far, center + reach);
  }
  if (near > far || near < kNearest || near >= *t) return;
  *t = near;
  *normal = Eigen::Vector3d::Zero();
  (*normal)[axis] = d[axis] > 0 ? -1.0 : 1.0;
}

// An upright cylinder with a lid, in its own frame.
void IntersectCylinder(const Ray& ray, double radius, double half_height, double* t,
                       Eigen::Vector3d* normal) {
  const auto& [o, d] = ray;
  const double a = d.head<2>().squaredNorm();
  const double b = o.head<2>().dot(d.head<2>());
  const double c = o.head<2>().squaredNorm() - radius * radius;
  const double discriminant = b * b - a * c;
  if (a > 0 && discriminant > 0) {
    const double near = (-b - std::sqrt(discriminant)) / a;
    if (near > kNearest && near < *t && std::abs(o.z() + near * d.z()) <= half_height) {
      *t = near;
      *normal = Eigen::Vector3d(o.x() + near * d.x(), o.y() + near * d.y(), 0) / radius;
    }
  }
  if (d.z() >= 0) return;  // the lid is seen from above only
  const double lid = (half_height - o.z()) / d.z();
  if (lid > kNearest && lid < *t && (o + lid * d).head<2>().norm() <= radius) {
    *t = lid;
    *normal = Eigen::Vector3d::UnitZ();
  }
}

// With the outward direction `angle`.
struct Wall {
  double angle, distance, half_width;
};

// The one with the outward direction `side` * pi/2; front and back walls run along x.
Wall WallOf(const Eigen::Vector3d& building, int side) {
  const bool is_front = side % 2 == 0;
  return {side * 0.5 * std::numbers::pi, is_front ? building.y() : building.x(),
          is_front ? building.x() : building.y()};
}

// Something of size `half`.
Solid OnWall(const Wall& wall, double along, double up, const Eigen::Vector3d& half, int material) {
  return {.center = RotatedZ({along, -wall.distance, up}, wall.angle),
          .half = half,
          .angle = wall.angle,
          .material = material};
}

void AddBuilding(Rng& rng, std::vector<Solid>* solids) {
  const Eigen::Vector2d ground = UniformVector({{0.7, 0.8}, {0.45, 0.6}}, rng);
  const Eigen::Vector3d half(ground.x(), ground.y(), 0.65);
  const Solid body{.center = {0, 0, kGroundHeight + half.z()},
                   .half = half,
                   .material = static_cast<int>(rng.UniformInt(3))};
  solids->push_back(body);
  Solid roof{.half = {0.7 * half.x(), 0.7 * half.y(), rng.Uniform(0.08, 0.2)},
             .material = body.material + 1};
  roof.center = {0.1 * rng.Gaussian(), 0, body.center.z() + half.z() + roof.half.z()};
  solids->push_back(roof);
  for (int side = 0; side < 4; ++side) {
    const Wall wall = WallOf(half, side);
    const double width = wall.half_width;
    for (int k = 0; k < 9; ++k) {
      const Eigen::Vector3d size = UniformVector({{0.05, 0.16}, {0.02, 0.13}, {0.04, 0.2}}, rng);
      const int material = body.material + 1 + static_cast<int>(rng.UniformInt(2));
      const Eigen::Vector2d at = UniformVector({{-0.85, 0.85}, {-0.6, 0.5}}, rng);
      solids->push_back(OnWall(wall, at.x() * width, at.y(), size, material));
    }
    for (int k = 0; k < 3; ++k) {
      Solid column = OnWall(wall, rng.Uniform(-0.9, 0.9) * width, 0, {0.04, 0.04, 0}, k);
      column.kind = Solid::Kind::kCylinder;
      column.half = {rng.Uniform(0.03, 0.06), 0, rng.Uniform(0.3, 0.6)};
      column.center += RotatedZ({0, -rng.Uniform(0.1, 0.25), 0}, column.angle);
      column.center.z() = kGroundHeight + column.half.z();
      solids->push_back(column);
    }
  }
}

void AddSurroundings(Rng& rng, std::vector<Solid>* solids) {
  for (int k = 0; k < 14; ++k) {
    Solid thing;
    thing.kind = k % 3 == 0 ? Solid::Kind::kCylinder : Solid::Kind::kBox;
    thing.half = {rng.Uniform(0.06, 0.15), rng.Uniform(0.06, 0.15), rng.Uniform(0.05, 0.2)};
    const double direction = 2.0 * std::numbers::pi * (k + rng.Uniform()) / 14.0;
    const double distance = rng.Uniform(1.1, 1.6);
    thing.center = {distance * std::cos(direction), distance * std::sin(direction),
                    kGroundHeight + thing.half.z()};
    thing.angle = rng.Uniform(0.0, std::numbers::pi);
    thing.material = static_cast<int>(rng.UniformInt(4));
    solids->push_back(thing);
  }
}

}  // namespace

double Solid::BoundingRadius() const {
  return kind == Kind::kBox ? half.norm() : std::hypot(half.x(), half.z());
}

void Solid::Intersect(const Ray& ray, Hit* hit) const {
  const Ray own{RotatedZ(ray.origin - center, -angle), RotatedZ(ray.direction, -angle)};
  double t = hit->t;
  Eigen::Vector3d normal;
  if (kind == Kind::kBox) {
    IntersectBox(own, half, &t, &normal);
  } else {
    IntersectCylinder(own, half.x(), half.z(), &t, &normal);
  }
  if (t < hit->t) *hit = {t, RotatedZ(normal, angle), material, -1};
}

World::World(uint64_t seed) : texture_(Rng(seed, "world_texture").NextU64()) {
  Rng rng(seed, "world");
  AddBuilding(rng, &solids_);
  AddSurroundings(rng, &solids_);
}

std::optional<Hit> World::Cast(const Ray& ray, std::span<const int> solids) const {
  Hit hit;
  if (ray.direction.z() < 0) {
    const double t = (kGroundHeight - ray.origin.z()) / ray.direction.z();
    const Eigen::Vector3d point = ray.origin + t * ray.direction;
    if (t > kNearest && point.head<2>().norm() < kGroundRadius) {
      hit = {t, Eigen::Vector3d::UnitZ(), kGroundMaterial, -1};
    }
  }
  for (const int i : solids) {
    const double before = hit.t;
    solids_[i].Intersect(ray, &hit);
    if (hit.t < before) hit.solid = i;
  }
  if (std::isinf(hit.t)) return std::nullopt;
  return hit;
}

std::vector<int> World::SolidsInCone(const Eigen::Vector3d& origin, const Eigen::Vector3d& axis,
                                     double radius) const {
  std::vector<int> candidates;
  for (size_t i = 0; i < solids_.size(); ++i) {
    const Eigen::Vector3d to_center = solids_[i].center - origin;
    const double distance = to_center.norm();
    const double size = solids_[i].BoundingRadius();
    if (distance > size) {
      const double angle = std::atan2(axis.cross(to_center).norm(), axis.dot(to_center));
      if (angle > radius + std::asin(size / distance)) continue;
    }
    candidates.push_back(static_cast<int>(i));
  }
  return candidates;
}

Eigen::Vector3f World::Shade(const Hit& hit, const Eigen::Vector3d& point, double footprint) const {
  static const Eigen::Vector3d sun = Eigen::Vector3d(0.35, -0.75, 0.6).normalized();
  const float light = 0.75f + 0.35f * static_cast<float>(hit.normal.dot(sun));
  return light * texture_.Color(point, hit.material, footprint);
}

Eigen::Vector3f World::SkyColor(const Eigen::Vector3d& direction) const {
  const float up = static_cast<float>(std::clamp(direction.normalized().z(), 0.0, 1.0));
  return {0.80f - 0.3f * up, 0.86f - 0.2f * up, 0.95f};
}

}  // namespace cairn
