#include "cairn/image/resample.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "cairn/base/check.h"
#include "image/cv_bitmap.h"

namespace cairn {
namespace {

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

// Rows of the target that are mapped at once: the maps of a band are a few megabytes.
constexpr int kBandRows = 64;

// `target` with as many pixels a radian as the source has, where it has fewer; else itself.
Camera AtResolutionOf(const Camera& source, const Camera& target) {
  const double factor = source.MeanFocal() / target.MeanFocal();
  if (factor <= 1.0) return target;
  const auto enlarge = [](int side, double by) {
    return std::min(kMaxResampledSide, static_cast<int>(std::lround(side * by)));
  };
  return ResizedPinhole(target, enlarge(target.width, factor), enlarge(target.height, factor));
}

// A camera, and how far off its axis (the tangent of the angle) its distortion folds the image
// over: what is farther off, some models show once more.
struct SourceCamera {
  Camera camera;
  double fold;
};

// Where the source shows a ray; nullopt where its distortion turns the image over.
std::optional<Eigen::Vector2d> PixelBeforeFold(const Camera& source, const Eigen::Vector2d& uv) {
  Eigen::Matrix<double, 2, 3> J;
  const auto pixel = source.ImgFromRay(uv.homogeneous(), &J);
  if (!pixel || !(J.leftCols<2>().determinant() > 0)) return std::nullopt;
  return pixel;
}

// The source of an image of the target. (Lenses are smooth: so many samples show a fold.)
SourceCamera FindFold(const Camera& source, const Camera& target) {
  constexpr int kNumSamples = 256;
  double farthest = 0;
  for (const int x : {0, target.width}) {
    for (const int y : {0, target.height}) {
      const auto uv = target.CamFromImg(Eigen::Vector2d(x, y));
      if (uv) farthest = std::max(farthest, uv->norm());
    }
  }
  for (int k = 1; k <= kNumSamples; ++k) {
    const double radius = farthest * k / kNumSamples;
    if (!PixelBeforeFold(source, {radius, 0})) return {source, radius};
  }
  return {source, std::numeric_limits<double>::infinity()};
}

// Where the source shows the ray of a target pixel, counted as OpenCV does (the center of the
// top-left pixel is 0); nullopt beyond the border, and beyond a fold.
std::optional<cv::Vec2f> SourcePosition(const SourceCamera& from, const Camera& target, int x,
                                        int y, Resampling resampling) {
  const Camera& source = from.camera;
  const auto uv = target.CamFromImg({x + 0.5, y + 0.5});
  if (!uv || uv->norm() > from.fold) return std::nullopt;
  const auto pixel = PixelBeforeFold(source, *uv);
  if (!pixel) return std::nullopt;
  const bool is_inside = pixel->x() >= 0 && pixel->x() <= source.width && pixel->y() >= 0 &&
                         pixel->y() <= source.height;
  if (!is_inside && resampling == Resampling::kLinear) return std::nullopt;
  return cv::Vec2f(static_cast<float>(std::clamp(pixel->x(), -8.0, source.width + 8.0) - 0.5),
                   static_cast<float>(std::clamp(pixel->y(), -8.0, source.height + 8.0) - 0.5));
}

// Rows of the target from `first` on.
struct Band {
  int first;
  cv::Mat rows;
};

void ResampleBand(const cv::Mat& in, const SourceCamera& source, const Camera& target,
                  Resampling resampling, const Band& band) {
  cv::Mat out = band.rows;
  cv::Mat map(out.rows, out.cols, CV_32FC2), blank(out.rows, out.cols, CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      const auto position = SourcePosition(source, target, x, band.first + y, resampling);
      map.at<cv::Vec2f>(y, x) = position.value_or(cv::Vec2f(0, 0));
      if (!position) blank.at<uint8_t>(y, x) = 255;
    }
  }
  const int flags = resampling == Resampling::kLinear ? cv::INTER_LINEAR : cv::INTER_CUBIC;
  cv::remap(in, out, map, cv::noArray(), flags, cv::BORDER_REPLICATE);
  out.setTo(cv::Scalar::all(0), blank);
}

Bitmap Blank(int width, int height, int channels) {
  Bitmap bitmap{width, height, channels, {}};
  bitmap.data.resize(static_cast<size_t>(width) * height * channels);
  return bitmap;
}

}  // namespace

Camera CenteredPinhole(const Camera& camera) {
  Camera pinhole = Camera::FromFocal(camera.camera_id, CameraModel::kSimplePinhole,
                                     camera.MeanFocal(), camera.width, camera.height);
  pinhole.has_prior_focal_length = camera.has_prior_focal_length;
  return pinhole;
}

Camera ResizedPinhole(const Camera& camera, int width, int height) {
  const double x = static_cast<double>(width) / camera.width;
  const double y = static_cast<double>(height) / camera.height;
  Camera resized = camera;
  resized.model = CameraModel::kPinhole;
  resized.width = width;
  resized.height = height;
  resized.params = {x * camera.FocalX(), y * camera.FocalY(), x * camera.PrincipalPoint().x(),
                    y * camera.PrincipalPoint().y()};
  return resized;
}

Bitmap ReducedBitmap(const Bitmap& bitmap, int width, int height) {
  Bitmap reduced = Blank(width, height, bitmap.channels);
  cv::Mat view = View(reduced);
  PrepareOpenCv();
  try {
    cv::resize(View(bitmap), view, view.size(), 0, 0, cv::INTER_AREA);
  } catch (const cv::Exception& exception) {
    ThrowIfOutOfMemory(exception);
    throw;
  }
  return reduced;
}

Bitmap ResampleBitmap(const Bitmap& bitmap, const Camera& source, const Camera& target,
                      Resampling resampling) {
  CAIRN_CHECK_EQ(bitmap.width, source.width);
  CAIRN_CHECK_EQ(bitmap.height, source.height);
  CAIRN_CHECK(bitmap.channels == 1 || bitmap.channels == 3);
  CAIRN_CHECK(target.IsPlanar());
  if (AreSame(source, target)) return bitmap;
  const Camera fine = AtResolutionOf(source, target);
  for (const Camera* camera : {&source, &target}) {
    CAIRN_CHECK_LE(std::max(camera->width, camera->height), kMaxResampledSide);
  }
  PrepareOpenCv();
  try {
    Bitmap out = Blank(fine.width, fine.height, bitmap.channels);
    const SourceCamera from = FindFold(source, fine);
    for (int y = 0; y < fine.height; y += kBandRows) {
      ResampleBand(View(bitmap), from, fine, resampling,
                   {y, View(out).rowRange(y, std::min(y + kBandRows, fine.height))});
    }
    if (fine.width == target.width && fine.height == target.height) return out;
    return ReducedBitmap(out, target.width, target.height);
  } catch (const cv::Exception& exception) {
    ThrowIfOutOfMemory(exception);
    throw;
  }
}

std::optional<Eigen::Vector2d> ResamplePixel(const Eigen::Vector2d& pixel, const Camera& source,
                                             const Camera& target) {
  const auto ray = source.RayFromImg(pixel);
  if (!ray) return std::nullopt;
  return target.ImgFromRay(*ray);
}

bool FoldsWithin(const Camera& source, const Camera& target) {
  return std::isfinite(FindFold(source, target).fold);
}

std::optional<Eigen::Vector2d> ShownPixel(const Eigen::Vector2d& pixel, const Camera& source,
                                          const Camera& target) {
  const auto uv = target.CamFromImg(pixel);
  return uv ? PixelBeforeFold(source, *uv) : std::nullopt;
}

}  // namespace cairn
