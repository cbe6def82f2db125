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

// Factors of the image's size along one axis: of the largest image that the photograph fills, and
// of the smallest that holds it.
struct Extent {
  double inner = kInfinity;
  double outer = 0;
};

Extent MeasureExtent(const Camera& camera, const Camera& pinhole, int axis,
                     const UndistortOptions& options) {
  const Side low = MeasureSide(camera, pinhole, axis, false);
  const Side high = MeasureSide(camera, pinhole, axis, true);
  const double size = axis == 0 ? camera.width : camera.height;
  // How far an image of scale 1 reaches from its principal point.
  const double below = options.center_principal_point ? size / 2 : pinhole.PrincipalPoint()[axis];
  const double above = size - below;
  // A principal point beyond the image: the side behind it limits nothing.
  return {
      std::min(below > 0 ? low.nearest / below : kInfinity,
               above > 0 ? high.nearest / above : kInfinity),
      std::max(below > 0 ? low.farthest / below : 0.0, above > 0 ? high.farthest / above : 0.0)};
}

// The pinhole of the photograph's size, with other sides.
Camera Scaled(const Camera& pinhole, double x, double y, const UndistortOptions& options) {
  Camera scaled = pinhole;
  // Whole pixels; a size that is whole but for rounding stays.
  scaled.width = std::max(1, static_cast<int>(x * pinhole.width + 1e-6));
  scaled.height = std::max(1, static_cast<int>(y * pinhole.height + 1e-6));
  scaled.params[2] *= static_cast<double>(scaled.width) / pinhole.width;
  scaled.params[3] *= static_cast<double>(scaled.height) / pinhole.height;
  if (options.center_principal_point) {
    scaled.params[2] = 0.5 * scaled.width;
    scaled.params[3] = 0.5 * scaled.height;
  }
  return scaled;
}

// Does the photograph show all pixels at the border of the undistorted image?
bool IsFilled(const Camera& camera, const Camera& pinhole) {
  if (FoldsWithin(camera, pinhole)) return false;
  const auto is_shown = [&](int x, int y) {
    const auto pixel = ShownPixel({x + 0.5, y + 0.5}, camera, pinhole);
    return pixel && pixel->minCoeff() >= 0 && pixel->x() <= camera.width &&
           pixel->y() <= camera.height;
  };
  for (int x = 0; x < pinhole.width; ++x) {
    if (!is_shown(x, 0) || !is_shown(x, pinhole.height - 1)) return false;
  }
  for (int y = 0; y < pinhole.height; ++y) {
    if (!is_shown(0, y) || !is_shown(pinhole.width - 1, y)) return false;
  }
  return true;
}

// Where the camera's distortion folds within the photograph, its outer part has no undistorted
// pixels, and a side that is part of it does not tell where the image must end. Then the largest
// image that is filled is searched for, of one scale along the axes that nothing limits.
void LimitToFilled(const Camera& camera, const Camera& pinhole, const UndistortOptions& options,
                   Extent& x, Extent& y) {
  const auto is_filled = [&](double x_scale, double y_scale) {
    const Camera scaled = Scaled(pinhole, std::min(x_scale, options.max_scale),
                                 std::min(y_scale, options.max_scale), options);
    return IsFilled(camera, scaled);
  };
  if (is_filled(x.inner, y.inner)) return;
  const double x_start = std::min(std::isinf(x.inner) ? y.inner : x.inner, options.max_scale);
  const double y_start = std::min(std::isinf(y.inner) ? x.inner : y.inner, options.max_scale);
  double filled = 0, too_large = 1;
  while (too_large - filled > 1e-4) {
    const double middle = 0.5 * (filled + too_large);
    (is_filled(middle * x_start, middle * y_start) ? filled : too_large) = middle;
  }
  x.inner = filled * x_start;
  y.inner = filled * y_start;
}

// The factor of the image's size along an axis. The smallest image that holds both sides and the
// largest that both fill are mixed by their inverses, as COLMAP does.
double Scale(const Extent& extent, const UndistortOptions& options) {
  const double scale =
      1.0 / ((1.0 - options.blank_pixels) / extent.inner + options.blank_pixels / extent.outer);
  if (!(extent.inner > 0) || !(scale > options.min_scale)) return options.min_scale;
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
  Extent x = MeasureExtent(camera, pinhole, 0, options);
  Extent y = MeasureExtent(camera, pinhole, 1, options);
  const bool has_unseen_border = std::isinf(std::max(x.outer, y.outer));
  if (has_unseen_border) LimitToFilled(camera, pinhole, options, x, y);
  pinhole = Scaled(pinhole, Scale(x, options), Scale(y, options), options);
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
