#pragma once

#include <Eigen/Core>
#include <optional>

namespace cairn::internal {

// A map of the plane and its derivatives: by the point, and by the model's extra parameters.
struct PlaneMap {
  double d[2];
  double J[4];
  double extra[2][12];
};

// Polynomial distortion of a plane, d = q R(r2) + tangential part + thin prism, with R = N / D.
// Coefficients are indices into the extra parameters.
struct Polynomial {
  int num_radial = 0;
  int radial[6] = {};
  int num_denominator = 0;
  int denominator[3] = {};
  int p1 = -1, p2 = -1;    // OpenCV's order: d_u has 2 p1 u v + p2 (r2 + 2 u^2)
  int sx = -1, sy = -1;    // times r2
  int sx2 = -1, sy2 = -1;  // times r4
  // Tangential part and prism act on the radially distorted point (Aria's model).
  bool is_two_steps = false;
};

// d and its derivatives at q; those by the extra parameters only if asked for.
PlaneMap Distort(const Polynomial& p, const double* extra, const double* q, bool derive_extra);

// The plane point that is distorted to d; its norm is at most max_r. Absent beyond the range in
// which the distorted radius grows with the radius.
std::optional<Eigen::Vector2d> Undistort(const Polynomial& p, const double* extra,
                                         const Eigen::Vector2d& d, double max_r);

}  // namespace cairn::internal
