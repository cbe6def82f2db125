#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/base/error.h"
#include "cairn/image/resample.h"
#include "cairn/undistortion/undistort.h"

namespace cairn {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Distances of a side of the photograph from the principal point on the undistorted image, pixels:
// of its nearest and of its farthest point.
struct Side {
  double nearest = kInfinity;
  double farthest = -kInfinity;
};

// The side across an axis of the image (0: x, 1: y), at its low or its high end, sampled at every
// pixel. Infinite where there is no undistorted pixel.
Side MeasureSide(const Camera& camera, const Camera& pinhole, int axis, bool is_high) {
  const int size[2] = {camera.width, camera.height};
  const double center = pinhole.PrincipalPoint()[axis];
  Side side;
  for (int i = 0; i <= size[1 - axis]; ++i) {
    Eigen::Vector2d point;
    point[axis] = is_high ? size[axis] : 0;
    point[1 - axis] = i;
    double distance = kInfinity;
    if (const auto pixel = ResamplePixel(point, camera, pinhole)) {
      distance = is_high ? (*pixel)[axis] - center : center - (*pixel)[axis];
    }
    side.nearest = std::min(side.nearest, distance);
    side.farthest = std::max(side.farthest, distance);
  }
  return side;
}

// The factor of the image's size along one axis. The smallest image that holds both sides and the
// largest that both fill are mixed by their inverses, as COLMAP does.
double Scale(const Camera& camera, const Camera& pinhole, int axis,
             const UndistortOptions& options) {
  const Side low = MeasureSide(camera, pinhole, axis, false);
  const Side high = MeasureSide(camera, pinhole, axis, true);
  const double size = axis == 0 ? camera.width : camera.height;
  // How far an image of scale 1 reaches from its principal point.
  const double below = options.center_principal_point ? size / 2 : pinhole.PrincipalPoint()[axis];
  const double above = size - below;
  // A principal point beyond the image: the side behind it limits nothing.
  const double inner = std::min(below > 0 ? low.nearest / below : kInfinity,
                                above > 0 ? high.nearest / above : kInfinity);
  const double outer =
      std::max(below > 0 ? low.farthest / below : 0.0, above > 0 ? high.farthest / above : 0.0);
  const double scale = 1.0 / ((1.0 - options.blank_pixels) / inner + options.blank_pixels / outer);
  if (!(inner > 0) || !(scale > options.min_scale)) return options.min_scale;
  return std::min(scale, options.max_scale);
}

}  // namespace

Camera UndistortedCamera(const Camera& camera, const UndistortOptions& options) {
  if (options.min_scale > options.max_scale) {
    throw ConfigError("min_scale", "is larger than max_scale");
  }
  if (camera.model == CameraModel::kEquirectangular) {
    throw ConfigError("model_path", "camera " + std::to_string(camera.camera_id) +
                                        " is a panorama, which no pinhole image holds");
  }
  Camera pinhole = camera;
  pinhole.model = CameraModel::kPinhole;
  const Eigen::Vector2d center = camera.PrincipalPoint();
  pinhole.params = {camera.FocalX(), camera.FocalY(), center.x(), center.y()};
  const double x = Scale(camera, pinhole, 0, options);
  const double y = Scale(camera, pinhole, 1, options);
  // Whole pixels; a size that is whole but for rounding stays.
  pinhole.width = std::max(1, static_cast<int>(x * camera.width + 1e-6));
  pinhole.height = std::max(1, static_cast<int>(y * camera.height + 1e-6));
  pinhole.params[2] *= static_cast<double>(pinhole.width) / camera.width;
  pinhole.params[3] *= static_cast<double>(pinhole.height) / camera.height;
  if (options.center_principal_point) {
    pinhole.params[2] = 0.5 * pinhole.width;
    pinhole.params[3] = 0.5 * pinhole.height;
  }
  const int limit = options.max_image_size > 0 ? options.max_image_size : kMaxResampledSide;
  const double factor = static_cast<double>(limit) / std::max(pinhole.width, pinhole.height);
  if (factor < 1) {
    const auto reduced = [&](int side) {
      return std::clamp(static_cast<int>(std::lround(side * factor)), 1, limit);
    };
    return ResizedPinhole(pinhole, reduced(pinhole.width), reduced(pinhole.height));
  }
  return pinhole;
}

}  // namespace cairn
