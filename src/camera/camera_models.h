#pragma once

#include <optional>
#include <string_view>

#include "cairn/camera/camera.h"
#include "camera/polynomial_distortion.h"

namespace cairn::internal {

// How a direction gets to the plane that focal lengths and principal point map to pixels.
enum class Family { kPlanar, kFisheye, kFov, kDivision, kEucm, kEquirectangular };

// Parameters: num_focals focal lengths, the principal point, then the extra ones. An
// equirectangular model has none of these, but its width and height.
struct ModelInfo {
  std::string_view name;
  Family family = Family::kPlanar;
  int num_focals = 0;
  int num_extra = 0;
  Polynomial polynomial = {};  // of planar models and fisheyes

  // Indices of parameters.
  int fx() const { return 0; }
  int fy() const { return num_focals - 1; }
  int cx() const { return num_focals; }
  int cy() const { return num_focals + 1; }
  int first_extra() const { return num_focals + 2; }
  int num_params() const { return first_extra() + num_extra; }
};

const ModelInfo& Info(CameraModel model);

// A direction on the plane.
struct PlanePoint {
  double d[2];
  double J[6];  // focal length * d(d)/d(point), 2 x 3 row-major
};

// Parameters of a model by what they do: focal lengths fx and fy, and the extra ones.
struct Lens {
  const double *f, *extra;
};

// The plane point of a point in the camera's frame, for every family but kEquirectangular. False
// where the model has none. The derivatives of d by the extra parameters are written unless J_extra
// is null.
bool Project(const ModelInfo& info, Lens lens, const double* point, const ExtraRows* J_extra,
             PlanePoint* out);

// The inverse: any direction, not normalized.
std::optional<Eigen::Vector3d> Unproject(const ModelInfo& info, const double* extra,
                                         const Eigen::Vector2d& d);

}  // namespace cairn::internal
