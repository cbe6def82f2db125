#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>

#include "cairn/io/gcp_file.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// Where the model has a control point.
struct LocatedPoint {
  Eigen::Vector3d in_model;
  std::map<image_t, Eigen::Vector2d> pixels;  // of the images that agree
};
// Triangulated from its measurements (Triangulate, with its usual thresholds); nullopt: fewer than
// two images of the model show it, or they contradict each other.
std::optional<LocatedPoint> LocatePoint(const Reconstruction& model,
                                        const std::map<std::string, image_t>& ids,
                                        const ControlPoint& point);

}  // namespace cairn
