#pragma once

#include <Eigen/Core>

#include "cairn/geometry/rigid3d.h"
#include "math/normal_equations.h"
#include "robust/point_pairs.h"

namespace cairn {

// Kernels over blocks of 16 correspondences, with the instruction set chosen at run time (Google
// Highway). Sums run in 16 fixed lanes and products are never fused with sums, so every x86-64
// machine gives the same bits.
//
// The error of a correspondence is the Sampson distance in pixels (Hartley and Zisserman, 11.9),
// |x2^T E x1| / sqrt((a^2 + b^2) / f2^2 + (c^2 + d^2) / f1^2) with (a, b, .) = E x1 and (c, d, .) =
// E^T x2, for E, or F, of normalized points. For wide pairs (PointPairs) it is that of bearings q
// of length 1, |q2^T E q1| / sqrt(|E q1|^2 s2^2 + |E^T q2|^2 s1^2), where s is the size of a pixel
// in radians at the bearing.

// MSAC support, sum of max(0, 1 - (error / max_error_px)^2): larger is better, one correspondence
// adds at most 1. Returns -1 as soon as the support cannot exceed `bound` any more.
double ScoreSampson(const PointPairs& points, const Eigen::Matrix3d& E, double max_error_px,
                    double bound = -1.0);

// Soft support, sum of s^2 / (s^2 + error^2) with scale s: it distinguishes rough models that MSAC
// scores as equally bad.
double SoftScoreSampson(const PointPairs& points, const Eigen::Matrix3d& E, double scale_px);

// errors_px[i] for every i < size(); must have room for num_blocks() * 16 values.
void SampsonErrors(const PointPairs& points, const Eigen::Matrix3d& E, float* errors_px);

// Symmetric transfer error of a homography of normalized points x2 ~ H x1,
// sqrt((|x2 - H x1|^2 f2^2 + |x1 - H^-1 x2|^2 f1^2) / 2), in pixels; infinite behind the horizon.
// For wide pairs, the sines of the angles between bearings take the place of these distances.
void HomographyErrors(const PointPairs& points, const Eigen::Matrix3d& H, float* errors_px);
// MSAC support of these errors, sum of max(0, 1 - (error / max_error_px)^2).
double ScoreHomography(const PointPairs& points, const Eigen::Matrix3d& H, double max_error_px);

// Robust losses of an error e at a scale s (IRLS weights as derivatives of the loss by e^2 s^2):
enum class RobustLoss {
  kTruncated,     // min(e^2 / s^2, 1)
  kGemanMcClure,  // e^2 / (s^2 + e^2): smooth, and reaches far beyond its scale
};

// Gauss-Newton terms of the Sampson errors at a pose, over (rotation: R <- Exp(w) R, 3;
// translation: t <- t + B b, 2). Weighted: hessian = sum w J^T J, gradient = sum w J^T e.
// cost: sum of losses, each at most 1. tangent: two directions B orthogonal to t. Errors in pixels.
NormalEquations<5> AccumulateSampson(const PointPairs& points, const Rigid3d& cam2_from_cam1,
                                     const Eigen::Matrix<double, 3, 2>& tangent, RobustLoss loss,
                                     double scale_px);

// The cost alone, to the bit.
double SampsonCost(const PointPairs& points, const Rigid3d& cam2_from_cam1, RobustLoss loss,
                   double scale_px);

}  // namespace cairn
