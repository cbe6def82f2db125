#pragma once

#include <array>
#include <string_view>

#include "cairn/camera/camera.h"

namespace cairn::internal {

// Where each model keeps what. -1: the model has no such parameter.
struct ModelInfo {
  CameraModel model;
  std::string_view name;
  int num_params;
  int fx, fy, cx, cy;
  int k1, k2, p1, p2;  // of the models that are no more than these
};

const ModelInfo& Info(CameraModel model);

// A direction on the plane that focal length and principal point map to pixels, before these.
struct PlanePoint {
  double d[2];
  double J[6];          // d(d)/d(point), 2 x 3 row-major
  double extra[2][12];  // d(d)/d(parameters after the principal point)
};

// The plane point of a point in the camera's frame, for every model but EQUIRECTANGULAR. False
// where the model has none. `extra` are the parameters after the principal point. Derivatives by
// these are left out unless asked for.
bool Project(CameraModel model, const double* extra, const double* point, bool derive_extra,
             PlanePoint* out);

// The inverse: any direction, not normalized.
std::optional<Eigen::Vector3d> Unproject(CameraModel model, const double* extra,
                                         const Eigen::Vector2d& d);

}  // namespace cairn::internal
