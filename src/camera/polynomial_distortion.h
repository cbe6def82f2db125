#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

namespace cairn::internal {

// A map of the plane and its derivative by the point.
struct PlaneMap {
  double d[2];
  double J[4];
};

// Two rows of derivatives by a model's extra parameters, zero where nothing is written.
using ExtraRows = std::array<double*, 2>;

// Polynomial distortion of a plane, d = q R(r2) + tangential part + thin prism, with R = N / D.
// Coefficients are indices into the extra parameters.
struct Polynomial {
  int num_radial = 0;  // 0: no distortion at all
  int radial[6] = {};
  int num_denominator = 0;
  int denominator[3] = {};
  int p1 = -1, p2 = -1;    // OpenCV's order: d_u has 2 p1 u v + p2 (r2 + 2 u^2)
  int sx = -1, sy = -1;    // times r2
  int sx2 = -1, sy2 = -1;  // times r4
  // Tangential part and prism act on the radially distorted point (Aria's model), whose
  // coefficients are the first.
  bool is_two_steps = false;
};

// d and its derivatives at q; those by the extra parameters unless J_extra is null.
PlaneMap Distort(const Polynomial& p, const double* extra, const double* q,
                 const ExtraRows* J_extra);

// The plane point that is distorted to d; its norm is at most max_r. Absent beyond the range in
// which the distorted radius grows with the radius.
std::optional<Eigen::Vector2d> Undistort(const Polynomial& p, const double* extra,
                                         const Eigen::Vector2d& d, double max_r);

}  // namespace cairn::internal
