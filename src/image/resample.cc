#include "cairn/image/resample.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "cairn/base/check.h"

namespace cairn {
namespace {

// Weights of the four samples around a position that lies `t` in [0, 1) after the second: the cubic
// of Keys, "Cubic convolution interpolation for digital image processing", 1981, a = -1/2.
std::array<double, 4> CubicWeights(double t) {
  const double t2 = t * t;
  const double t3 = t2 * t;
  return {0.5 * (-t3 + 2 * t2 - t), 0.5 * (3 * t3 - 5 * t2 + 2), 0.5 * (-3 * t3 + 4 * t2 + t),
          0.5 * (t3 - t2)};
}

// Reads the bitmap at a pixel (center of the top-left pixel is (0.5, 0.5)).
void Interpolate(const Bitmap& bitmap, const Eigen::Vector2d& pixel, uint8_t* out) {
  const double x = std::clamp(pixel.x() - 0.5, -4.0, bitmap.width + 3.0);
  const double y = std::clamp(pixel.y() - 0.5, -4.0, bitmap.height + 3.0);
  const int x0 = static_cast<int>(std::floor(x));
  const int y0 = static_cast<int>(std::floor(y));
  const std::array<double, 4> wx = CubicWeights(x - x0);
  const std::array<double, 4> wy = CubicWeights(y - y0);
  double sum[3] = {};
  for (int j = 0; j < 4; ++j) {
    const int row = std::clamp(y0 + j - 1, 0, bitmap.height - 1);
    for (int i = 0; i < 4; ++i) {
      const int column = std::clamp(x0 + i - 1, 0, bitmap.width - 1);
      const uint8_t* in = bitmap.Pixel(column, row);
      for (int c = 0; c < bitmap.channels; ++c) sum[c] += wx[i] * wy[j] * in[c];
    }
  }
  for (int c = 0; c < bitmap.channels; ++c) {
    out[c] = static_cast<uint8_t>(std::clamp(std::lround(sum[c]), 0l, 255l));
  }
}

// Whether a source pixel, mapped to the target, is itself: then nothing need be resampled.
bool AreSame(const Camera& source, const Camera& target) {
  if (source.width != target.width || source.height != target.height) return false;
  if (!source.IsPlanar() || !target.IsPlanar()) return false;
  for (const int index : source.DistortionIndices()) {
    if (source.params[index] != 0) return false;
  }
  for (const int index : target.DistortionIndices()) {
    if (target.params[index] != 0) return false;
  }
  return source.CalibrationMatrix() == target.CalibrationMatrix();
}

}  // namespace

Camera CenteredPinhole(const Camera& camera) {
  Camera pinhole = Camera::FromFocal(camera.camera_id, CameraModel::kSimplePinhole,
                                     camera.MeanFocal(), camera.width, camera.height);
  pinhole.has_prior_focal_length = camera.has_prior_focal_length;
  return pinhole;
}

Bitmap ResampleBitmap(const Bitmap& bitmap, const Camera& source, const Camera& target) {
  CAIRN_CHECK_EQ(bitmap.width, source.width);
  CAIRN_CHECK_EQ(bitmap.height, source.height);
  CAIRN_CHECK(bitmap.channels == 1 || bitmap.channels == 3);
  if (AreSame(source, target)) return bitmap;
  Bitmap out{
      .width = target.width, .height = target.height, .channels = bitmap.channels, .data = {}};
  out.data.resize(static_cast<size_t>(out.width) * out.height * out.channels);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      const auto uv = target.CamFromImg({x + 0.5, y + 0.5});
      if (uv) Interpolate(bitmap, source.ImgFromCam(*uv), out.Pixel(x, y));
    }
  }
  return out;
}

std::optional<Eigen::Vector2d> ResamplePixel(const Eigen::Vector2d& pixel, const Camera& source,
                                             const Camera& target) {
  const auto uv = source.CamFromImg(pixel);
  if (!uv) return std::nullopt;
  return target.ImgFromCam(*uv);
}

}  // namespace cairn
