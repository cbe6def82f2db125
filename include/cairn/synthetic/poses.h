#pragma once

#include <Eigen/Core>
#include <vector>

#include "cairn/base/named_value.h"
#include "cairn/base/options.h"
#include "cairn/base/rng.h"
#include "cairn/geometry/rigid3d.h"

namespace cairn {

// The synthetic world: z up; the scene's center is the origin, its size about 1 (radius).
// cam_from_world of a camera at `center` that looks at `target`, its y axis pointing down as far as
// possible, then rolled by `roll` radians around its viewing direction. `center` must not lie
// vertically above or below `target`.
Rigid3d LookAt(const Eigen::Vector3d& center, const Eigen::Vector3d& target, double roll = 0.0);

// A rotation drawn uniformly from SO(3).
Eigen::Quaterniond RandomRotation(Rng& rng);
// A direction drawn uniformly from the unit sphere.
Eigen::Vector3d RandomDirection(Rng& rng);
// Such a direction times a length, drawn after it.
Eigen::Vector3d RandomOfLength(double min, double max, Rng& rng);

// Errors of relative poses.
struct EdgeNoise {
  double rotation_noise_deg = 0.0;   // median angle of the error
  double direction_noise_deg = 0.0;  // median angle between true and given translation direction
  double heavy_tail = 0.0;  // 0: Rayleigh-like errors; 1: as real edges (1DSfM's Ellis Island)

  void VisitFields(OptionVisitor& v);
};

enum class CameraLayout {
  kRing,      // evenly around the scene, at one distance: one long loop
  kArc,       // on an arc of 100 degrees in front (negative y), in two heights
  kStreet,    // along a front as long as it takes, straight at it: a strip, which may bend
  kLandmark,  // as tourists: clusters around the scene, at different distances and heights
  kCity,      // so around many places on a grid of streets, two and two of which look alike
};
inline constexpr NamedValue<CameraLayout> kCameraLayouts[] = {{CameraLayout::kRing, "ring"},
                                                              {CameraLayout::kArc, "arc"},
                                                              {CameraLayout::kStreet, "street"},
                                                              {CameraLayout::kLandmark, "landmark"},
                                                              {CameraLayout::kCity, "city"}};

// Of kStreet: from one camera to the next, in units of the distance.
inline constexpr double kStreetStep = 0.15;

// cam_from_world of `num_cameras` cameras, with small random deviations from the layout; `distance`
// (world units) is the typical distance from the scene's center.
std::vector<Rigid3d> MakeCameraPoses(CameraLayout layout, int num_cameras, double distance,
                                     Rng& rng);

}  // namespace cairn
