#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/base/named_value.h"
#include "cairn/base/types.h"

namespace cairn {

// COLMAP's camera models, with COLMAP's ids and parameter orders.
enum class CameraModel : int {
  kSimplePinhole = 0,            // f, cx, cy
  kPinhole = 1,                  // fx, fy, cx, cy
  kSimpleRadial = 2,             // f, cx, cy, k
  kRadial = 3,                   // f, cx, cy, k1, k2
  kOpenCV = 4,                   // fx, fy, cx, cy, k1, k2, p1, p2
  kOpenCVFisheye = 5,            // fx, fy, cx, cy, k1, k2, k3, k4
  kFullOpenCV = 6,               // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
  kFov = 7,                      // fx, fy, cx, cy, omega
  kSimpleRadialFisheye = 8,      // f, cx, cy, k
  kRadialFisheye = 9,            // f, cx, cy, k1, k2
  kThinPrismFisheye = 10,        // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1
  kRadTanThinPrismFisheye = 11,  // fx, fy, cx, cy, k0 .. k5, p0, p1, s0 .. s3
  kSimpleDivision = 12,          // f, cx, cy, k
  kDivision = 13,                // fx, fy, cx, cy, k
  kSimpleFisheye = 14,           // f, cx, cy
  kFisheye = 15,                 // fx, fy, cx, cy
  kEucm = 16,                    // fx, fy, cx, cy, alpha, beta
  kEquirectangular = 17,         // width, height
};
inline constexpr int kNumCameraModels = 18;
inline constexpr int kMaxCameraParams = 16;  // of any model

// Plausible focal lengths, in larger sides of the image: 118 and 9 degrees across it.
inline constexpr double kShortestFocal = 0.3, kLongestFocal = 6.6;

std::optional<CameraModel> CameraModelFromName(std::string_view name);  // "SIMPLE_PINHOLE", ...
std::optional<CameraModel> CameraModelFromId(int id);
std::string_view CameraModelName(CameraModel model);
int CameraModelNumParams(CameraModel model);
// All models with their names, by id.
std::span<const NamedValue<CameraModel>> NamedCameraModels();
// Whether a pixel is a polynomial, or a quotient of polynomials, of (x / z, y / z): then errors in
// pixels are nearly proportional to errors on the undistorted plane, and nothing beside or behind
// the camera is visible. The other models (fisheye lenses, panoramas, and models that can express
// them) are handled by unit bearings.
bool CameraModelIsPlanar(CameraModel model);
// Whether the radius is a polynomial of the angle off axis that is close to the angle itself.
bool CameraModelIsFisheye(CameraModel model);

// A central camera. Pixels as COLMAP: the center of the top-left pixel is (0.5, 0.5). Normalized
// points are rays with third component 1, which not all rays of a wide field have; bearings are
// rays of length 1.
struct Camera {
  camera_t camera_id = kInvalidCameraId;
  CameraModel model = CameraModel::kSimpleRadial;
  int width = 0;   // pixels
  int height = 0;  // pixels
  std::vector<double> params;
  // The focal length comes from the user or EXIF, not from a guess.
  bool has_prior_focal_length = false;

  // A camera with the given focal length (pixels), the principal point at the image center, no
  // distortion (FOV: COLMAP's 0.01). An equirectangular one has the focal length of its size.
  static Camera FromFocal(camera_t id, CameraModel model, double focal_px, int width, int height);

  bool IsPlanar() const { return CameraModelIsPlanar(model); }

  // Pixels a radian (of the tangent, for planar models) at the center of the image.
  double FocalX() const;
  double FocalY() const;
  double MeanFocal() const { return 0.5 * (FocalX() + FocalY()); }
  Eigen::Vector2d PrincipalPoint() const;
  // The pinhole part [fx 0 cx; 0 fy cy; 0 0 1]. Meaningless for models that are not planar.
  Eigen::Matrix3d CalibrationMatrix() const;
  // Scales all focal lengths so that their mean is focal_px. Does nothing without focal lengths.
  void SetMeanFocal(double focal_px);
  double DiagonalPx() const;
  // How much farther off keypoints are, in pixels, than those of smaller photographs: COLMAP and we
  // find features in images of at most 3200 px.
  double ErrorScale() const { return std::max(1.0, std::max(width, height) / 3200.0); }

  // Indices into params: focal lengths, principal point, distortion.
  std::vector<int> FocalIndices() const;
  std::vector<int> PrincipalPointIndices() const;
  std::vector<int> DistortionIndices() const;

  // Checks counts and finiteness of params, positive focal and size. Returns "" or the reason.
  std::string Validate() const;

  // Pixel of the point (any distance but 0) in the camera's frame; nullopt where the model has
  // none: behind a planar camera, beyond the field of another. J, if given, is d(pixel)/d(point).
  std::optional<Eigen::Vector2d> ImgFromRay(const Eigen::Vector3d& point,
                                            Eigen::Matrix<double, 2, 3>* J = nullptr) const;
  // The unit bearing of a pixel; nullopt where the model has none (as CamFromImg). Radial parts are
  // undone within the range in which the radius grows with the angle off axis.
  std::optional<Eigen::Vector3d> RayFromImg(const Eigen::Vector2d& pixel) const;
  // The size of a pixel in radians at a point of the camera's frame: the root of its solid angle;
  // infinite where ImgFromRay has no value.
  double RadiansPerPx(const Eigen::Vector3d& point) const;

  // Pixel of the ray (u, v, 1), and if given, J_uv = d(pixel)/d(u, v), and d(pixel)/d(params), 2 x
  // NumParams row-major, in J_params. Not a number where the model has none.
  Eigen::Vector2d ImgFromCam(const Eigen::Vector2d& uv, Eigen::Matrix2d* J_uv = nullptr,
                             double* J_params = nullptr) const;
  // Ray (u, v) with third component 1 of a pixel; distortion is removed by Newton's method, and
  // nullopt means that it did not converge (a pixel beyond what the distortion model can express),
  // or that the ray does not point forward.
  // J, if given, is d(u, v)/d(pixel).
  std::optional<Eigen::Vector2d> CamFromImg(const Eigen::Vector2d& pixel,
                                            Eigen::Matrix2d* J = nullptr) const;
};

// The default inlier threshold of a match, pixels from its epipolar line: 0.1 % of the diagonal,
// but at least 1, the precision of a keypoint's position. (Eichhardt and Barath 2020 have 0.05 %,
// which is too little where lenses are known roughly.)
double DefaultMaxErrorPx(const Camera& camera1, const Camera& camera2);
// The standard deviation of a match, by default: half of that, but at least 1.
double DefaultSigmaPx(const Camera& camera1, const Camera& camera2);

// A model and its parameters, wherever they are kept.
struct CameraParams {
  CameraModel model;
  const double* values;
};

// Projection of a point in the camera's frame, with explicit params (bundle adjustment's inner
// loop). Any Jacobian pointer, d(pixel)/d(point) and d(pixel)/d(params), row-major, may be null.
// False where the model has no pixel; what is written then means nothing. No allocation.
bool ImgFromRay(const CameraParams& params, const double* point, double* pixel, double* J_point_2x3,
                double* J_params_2xn);

// From one pixel to another, the short way around where the picture closes (panoramas).
inline Eigen::Vector2d PixelDifference(const CameraParams& params, const Eigen::Vector2d& to,
                                       const Eigen::Vector2d& from) {
  Eigen::Vector2d difference = to - from;
  if (params.model == CameraModel::kEquirectangular) {
    difference.x() = std::remainder(difference.x(), params.values[0]);
  }
  return difference;
}

}  // namespace cairn
