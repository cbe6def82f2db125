#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/base/types.h"

namespace cairn {

// COLMAP's camera models, with COLMAP's ids and parameter orders.
enum class CameraModel : int {
  kSimplePinhole = 0,  // f, cx, cy
  kPinhole = 1,        // fx, fy, cx, cy
  kSimpleRadial = 2,   // f, cx, cy, k
  kRadial = 3,         // f, cx, cy, k1, k2
  kOpenCV = 4,         // fx, fy, cx, cy, k1, k2, p1, p2
};

std::optional<CameraModel> CameraModelFromName(std::string_view name);  // "SIMPLE_PINHOLE", ...
std::optional<CameraModel> CameraModelFromId(int id);
std::string_view CameraModelName(CameraModel model);
int CameraModelNumParams(CameraModel model);

// A central camera. Pixels as COLMAP: the center of the top-left pixel is (0.5, 0.5). Normalized
// points are rays with third component 1.
struct Camera {
  camera_t camera_id = kInvalidCameraId;
  CameraModel model = CameraModel::kSimpleRadial;
  int width = 0;   // pixels
  int height = 0;  // pixels
  std::vector<double> params;
  // The focal length comes from the user or EXIF, not from a guess.
  bool has_prior_focal_length = false;

  // A camera with the given focal length (pixels), the principal point at the image center, no
  // distortion.
  static Camera FromFocal(camera_t id, CameraModel model, double focal_px, int width, int height);

  double FocalX() const;
  double FocalY() const;
  double MeanFocal() const { return 0.5 * (FocalX() + FocalY()); }
  Eigen::Vector2d PrincipalPoint() const;
  // The pinhole part [fx 0 cx; 0 fy cy; 0 0 1].
  Eigen::Matrix3d CalibrationMatrix() const;
  // Scales all focal lengths so that their mean is focal_px.
  void SetMeanFocal(double focal_px);
  double DiagonalPx() const;

  // Indices into params: focal lengths, principal point, distortion.
  std::vector<int> FocalIndices() const;
  std::vector<int> PrincipalPointIndices() const;
  std::vector<int> DistortionIndices() const;

  // Checks counts and finiteness of params, positive focal and size. Returns "" or the reason.
  std::string Validate() const;

  // Pixel of the ray (u, v, 1). J_uv, if given, is d(pixel)/d(u, v).
  Eigen::Vector2d ImgFromCam(const Eigen::Vector2d& uv, Eigen::Matrix2d* J_uv = nullptr) const;
  // Also d(pixel)/d(params), 2 x NumParams row-major, written to J_params.
  Eigen::Vector2d ImgFromCam(const Eigen::Vector2d& uv, Eigen::Matrix2d* J_uv,
                             double* J_params) const;
  // Ray (u, v) with third component 1 of a pixel; distortion is removed by Newton's method, and
  // nullopt means that it did not converge (a pixel beyond what the distortion model can express).
  // J, if given, is d(u, v)/d(pixel).
  std::optional<Eigen::Vector2d> CamFromImg(const Eigen::Vector2d& pixel,
                                            Eigen::Matrix2d* J = nullptr) const;
  // A threshold in pixels as one in normalized coordinates: divided by the mean focal length.
  double CamFromImgThreshold(double threshold_px) const { return threshold_px / MeanFocal(); }
};

// Projection with explicit params (bundle adjustment's inner loop). Same meaning as
// Camera::ImgFromCam; any Jacobian pointer may be null. No allocation.
void ImgFromCam(CameraModel model, const double* params, const double* uv, double* pixel,
                double* J_uv_2x2, double* J_params_2xn);

}  // namespace cairn
