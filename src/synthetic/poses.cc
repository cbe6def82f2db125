#include "cairn/synthetic/poses.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cairn/base/check.h"
#include "cairn/math/angles.h"
#include "math/random_vectors.h"
#include "synthetic/city.h"

namespace cairn {
namespace {

constexpr double kPi = std::numbers::pi;

// Where a camera stands and what it looks at.
struct Placement {
  Eigen::Vector3d center;
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
};

// From the front (negative y) at `angle` radians to the right.
Eigen::Vector3d FrontCenter(double distance, double angle, double height) {
  return {distance * std::sin(angle), -distance * std::cos(angle), height};
}

// A few spots where many stand; most of the cameras look straight at the landmark.
Placement Landmark(int num_spots, double distance, Rng& rng) {
  // Popularity falls with the spot's rank; spots are spread by the golden angle.
  const double u = rng.Uniform();
  const int spot = static_cast<int>(num_spots * u * u);
  const double angle = spot * kPi * (3.0 - std::sqrt(5.0)) + 0.3 * rng.Gaussian();
  const double d = std::max(1.5, distance * std::exp(0.3 * rng.Gaussian()));
  const double height = distance * 0.08 * std::abs(rng.Gaussian());
  Placement placement{FrontCenter(d, angle, height)};
  placement.target = 0.2 * GaussianVector<3>(rng);
  return placement;
}

// Camera i of n.
Placement Place(CameraLayout layout, int i, int n, double distance, Rng& rng) {
  constexpr int kSpotsOfCity = 12;  // around each place
  if (layout == CameraLayout::kCity) return Landmark(kSpotsOfCity, distance, rng);
  if (layout == CameraLayout::kLandmark) return Landmark(std::max(4, n / 60), distance, rng);
  if (layout == CameraLayout::kRing) {
    return {FrontCenter(distance, 2.0 * kPi * i / n, 0.1 * distance)};
  }
  if (layout == CameraLayout::kArc) {
    const double along = n > 1 ? static_cast<double>(i) / (n - 1) - 0.5 : 0.0;
    return {FrontCenter(distance, DegToRad(100.0) * along, (i % 2 == 0 ? 0.02 : 0.22) * distance)};
  }
  // A street. An image's width and height are near 0.8 and 0.6 of the distance: five images show a
  // place.
  const double x = kStreetStep * distance * (i - 0.5 * (n - 1));
  return {{x, -distance, 0}, {x, 0, 0}};
}

}  // namespace

Rigid3d LookAt(const Eigen::Vector3d& center, const Eigen::Vector3d& target, double roll) {
  const Eigen::Vector3d z = (target - center).normalized();
  Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ());
  CAIRN_CHECK_GT(x.norm(), 1e-9);
  x.normalize();
  Eigen::Matrix3d R;
  R.row(0) = x;
  R.row(1) = z.cross(x);
  R.row(2) = z;
  R = Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()).toRotationMatrix() * R;
  return {R, -R * center};
}

Eigen::Quaterniond RandomRotation(Rng& rng) {
  const auto q = GaussianVector<4>(rng);
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
}

Eigen::Vector3d RandomDirection(Rng& rng) { return GaussianVector<3>(rng).normalized(); }

Eigen::Vector3d RandomOfLength(double min, double max, Rng& rng) {
  const Eigen::Vector3d direction = RandomDirection(rng);
  return rng.Uniform(min, max) * direction;
}

std::vector<Rigid3d> MakeCameraPoses(CameraLayout layout, int num_cameras, double distance,
                                     Rng& rng) {
  const City city(num_cameras);
  std::vector<Rigid3d> poses;
  for (int i = 0; i < num_cameras; ++i) {
    Placement placement = Place(layout, i, num_cameras, distance, rng);
    for (int k = 0; k < 3; ++k) {
      placement.center[k] += 0.02 * distance * rng.Gaussian();
      placement.target[k] += 0.05 * rng.Gaussian();
    }
    poses.push_back(LookAt(placement.center, placement.target, DegToRad(2.0) * rng.Gaussian()));
    if (layout == CameraLayout::kCity) {
      poses.back() = poses.back() * Inverse(city.WorldFromPlace(city.PlaceOf(i)));
    }
  }
  return poses;
}

}  // namespace cairn
