#pragma once

#include <Eigen/Core>
#include <vector>

#include "intrinsics/distortion_calibration.h"
#include "intrinsics/fundamental_fit.h"
#include "math/normal_equations.h"

namespace cairn::internal {

// The matches of one pair, right and wrong, as its cameras see them with changing distortion. The
// error of a match is Sampson's in the distorted image, where the noise is: distances in the
// undistorted one shrink and grow with the parameter that is sought. Its loss is Geman and
// McClure's, e^2 / (s^2 + e^2); a match that a camera cannot express has the largest, 1.
class DistortedPair {
 public:
  DistortedPair(const DistortionPair& pair, const Camera& camera1, const Camera& camera2);

  // k of both cameras from now on; those that have distortion, or cannot have it, keep theirs.
  void SetDistortion(double k1, double k2);

  // Levenberg-Marquardt from F; returns the cost.
  double Refine(double scale_px, int max_iterations, FundamentalFactors* F);

  // Normal equations over both k, all four elements of the hessian, F having been eliminated: it
  // moves along (Schur complement).
  NormalEquations<2> Reduce(const FundamentalFactors& F, double scale_px);

  // Standard deviation of the errors of what F explains, by their median.
  double NoisePx(const FundamentalFactors& F, double max_sigma_px);
  int NumExplained(const FundamentalFactors& F, double max_error_px);
  // Undistorted pixels (by nominal focal lengths) of what F explains.
  FocalPair Explained(const FundamentalFactors& F, double max_error_px, int max_num);

  int size() const { return static_cast<int>(pixels_[0].size()); }

 private:
  struct Ray {
    Eigen::Vector3d x;         // third component 1
    Eigen::Matrix2d by_pixel;  // d x / d pixel
    // Of the same pixel when k changes.
    Eigen::Vector2d x_by_k;
    Eigen::Matrix2d by_pixel_by_k;
  };
  void Undistort(int side);
  void Evaluate(const Eigen::Matrix3d& F);
  // d error / d vec(F) (columns one after the other) and, if it is asked for, / d both k.
  Eigen::Matrix<double, 9, 1> ErrorByF(const Eigen::Matrix3d& F, int i,
                                       Eigen::Vector2d* by_k = nullptr) const;
  // Normal equations over the steps of F and, with distortion, both k.
  template <bool kWithDistortion>
  auto Linearize(const FundamentalFactors& F, double scale_px);

  camera_t camera_ids_[2];
  Camera cameras_[2];
  bool is_free_[2];
  std::vector<Eigen::Vector2d> pixels_[2];
  std::vector<Ray> rays_[2];
  std::vector<char> is_valid_[2];
  std::vector<double> errors_, precisions_;
};

}  // namespace cairn::internal
