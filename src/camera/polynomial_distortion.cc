#include "camera/polynomial_distortion.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::internal {
namespace {

double Coefficient(const double* extra, int index) { return index < 0 ? 0.0 : extra[index]; }

// The radial factor R = N / D, R - 1 without the loss of digits, and dR/d(r2).
struct Radial {
  double excess, slope;
  double denominator;
};

Radial RadialAt(const Polynomial& p, const double* extra, double r2) {
  double n = 0.0, d = 0.0, dn = 0.0, dd = 0.0;  // N - 1, D - 1 and the derivatives of N and D
  double power = 1.0;                           // r2^i
  for (int i = 0; i < std::max(p.num_radial, p.num_denominator); ++i) {
    double a = i < p.num_radial ? extra[p.radial[i]] : 0.0;
    double b = i < p.num_denominator ? extra[p.denominator[i]] : 0.0;
    dn += (i + 1) * a * power;
    dd += (i + 1) * b * power;
    power *= r2;
    for (int k = 0; k <= i; ++k) {  // not by the power: the models' last digits depend on it
      a *= r2;
      b *= r2;
    }
    n += a;
    d += b;
  }
  if (p.num_denominator == 0) return {n, dn, 1.0};
  const double D = 1.0 + d;
  return {(n - d) / D, (dn * D - (1.0 + n) * dd) / (D * D), D};
}

// q times the radial factor.
void RadialPart(const Polynomial& p, const double* extra, const double* q, const ExtraRows* J_extra,
                PlaneMap* out) {
  const double r2 = q[0] * q[0] + q[1] * q[1];
  const Radial radial = RadialAt(p, extra, r2);
  const double factor = 1.0 + radial.excess;
  for (int i = 0; i < 2; ++i) {
    out->d[i] = q[i] + q[i] * radial.excess;
    for (int j = 0; j < 2; ++j) {
      out->J[2 * i + j] = (i == j ? factor : 0.0) + 2.0 * (q[i] * q[j]) * radial.slope;
    }
  }
  if (!J_extra) return;
  for (int i = 0; i < 2; ++i) {
    double power = q[i] / radial.denominator;  // times r2^(k + 1)
    for (int k = 0; k < std::max(p.num_radial, p.num_denominator); ++k) {
      power *= r2;
      if (k < p.num_radial) (*J_extra)[i][p.radial[k]] = power;
      if (k < p.num_denominator) (*J_extra)[i][p.denominator[k]] = -factor * power;
    }
  }
}

// Tangential part and thin prism of q: added to d and J.
void AddDecentering(const Polynomial& p, const double* extra, const double* q,
                    const ExtraRows* J_extra, PlaneMap* out) {
  if (p.p1 < 0) return;
  const double u = q[0], v = q[1];
  const double uu = u * u, vv = v * v, uv = u * v, r2 = uu + vv;
  const double p1 = extra[p.p1], p2 = extra[p.p2];
  const double sx = Coefficient(extra, p.sx), sy = Coefficient(extra, p.sy);
  const double sx2 = Coefficient(extra, p.sx2), sy2 = Coefficient(extra, p.sy2);
  double* const d = out->d;
  double* const J = out->J;
  d[0] = d[0] + 2.0 * p1 * uv + p2 * (r2 + 2.0 * uu) + (sx + sx2 * r2) * r2;
  d[1] = d[1] + 2.0 * p2 * uv + p1 * (r2 + 2.0 * vv) + (sy + sy2 * r2) * r2;
  const double dx = 2.0 * (sx + 2.0 * sx2 * r2), dy = 2.0 * (sy + 2.0 * sy2 * r2);
  J[0] = J[0] + 2.0 * p1 * v + 6.0 * p2 * u + dx * u;
  J[1] = J[1] + 2.0 * p1 * u + 2.0 * p2 * v + dx * v;
  J[2] = J[2] + 2.0 * p2 * v + 2.0 * p1 * u + dy * u;
  J[3] = J[3] + 2.0 * p2 * u + 6.0 * p1 * v + dy * v;
  if (!J_extra) return;
  (*J_extra)[0][p.p1] = 2.0 * uv;
  (*J_extra)[1][p.p1] = r2 + 2.0 * vv;
  (*J_extra)[0][p.p2] = r2 + 2.0 * uu;
  (*J_extra)[1][p.p2] = 2.0 * uv;
  if (p.sx >= 0) (*J_extra)[0][p.sx] = r2;
  if (p.sy >= 0) (*J_extra)[1][p.sy] = r2;
  if (p.sx2 >= 0) (*J_extra)[0][p.sx2] = r2 * r2;
  if (p.sy2 >= 0) (*J_extra)[1][p.sy2] = r2 * r2;
}

// The second of two steps: d(second)/d(first) times columns of the first's derivatives.
void Chain(const PlaneMap& second, double* row0, double* row1, int num_columns) {
  for (int k = 0; k < num_columns; ++k) {
    const double a = row0[k], b = row1[k];
    row0[k] = second.J[0] * a + second.J[1] * b;
    row1[k] = second.J[2] * a + second.J[3] * b;
  }
}

// Radius after the radial part, and its derivative.
struct RadiusMap {
  double value, slope;
};

RadiusMap RadiusAt(const Polynomial& p, const double* extra, double r) {
  const Radial radial = RadialAt(p, extra, r * r);
  if (!(radial.denominator > 0.0)) return {0.0, -1.0};  // beyond a pole nothing is meant
  return {r + r * radial.excess, 1.0 + radial.excess + 2.0 * r * r * radial.slope};
}

// Does the distorted radius grow all the way to r? Lenses are smooth: so many samples show a fold.
bool Grows(const Polynomial& p, const double* extra, double r) {
  constexpr int kNumSamples = 16;
  // What every coefficient takes from a slope of 1 at most, here and further in.
  double most = 0.0, power = 1.0;
  for (int i = 0; i < p.num_radial; ++i) {
    power *= r * r;
    most += (2 * i + 3) * std::abs(extra[p.radial[i]]) * power;
  }
  if (p.num_denominator == 0 && most < 1.0) return true;
  for (int k = 1; k <= kNumSamples; ++k) {
    if (!(RadiusAt(p, extra, r * k / kNumSamples).slope > 0.0)) return false;
  }
  return true;
}

// The radius below max_r, on the first branch on which the distorted one grows, whose distorted one
// is next to `target`: step by step, until the target is passed or the growth ends, then bisection.
double UndistortRadius(const Polynomial& p, const double* extra, double target, double max_r) {
  constexpr int kNumSteps = 256;
  double low = 0.0;
  const double last = std::isfinite(max_r) ? max_r : 64.0;
  for (int k = 1; k <= kNumSteps; ++k) {
    // Finer near the center where there is no largest radius.
    const double t = static_cast<double>(k) / kNumSteps;
    double high = last * (std::isfinite(max_r) ? t : t * t);
    const auto is_before = [&](double r) {
      const RadiusMap map = RadiusAt(p, extra, r);
      return map.slope > 0.0 && map.value < target;
    };
    if (is_before(high)) {
      low = high;
      continue;
    }
    for (int i = 0; i < 100; ++i) {
      const double middle = 0.5 * (low + high);
      (is_before(middle) ? low : high) = middle;
    }
    break;
  }
  return low;
}

// Newton's method from q on. Absent where the distortion folds over, for the model has no inverse
// there, and where it does not converge.
std::optional<Eigen::Vector2d> SolveForPoint(const Polynomial& p, const double* extra,
                                             const Eigen::Vector2d& d, Eigen::Vector2d q) {
  double squared_step = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < 50; ++iteration) {
    const PlaneMap map = Distort(p, extra, q.data(), nullptr);
    const Eigen::Matrix2d J{{map.J[0], map.J[1]}, {map.J[2], map.J[3]}};
    if (!(J.determinant() > 1e-3)) return std::nullopt;
    if (squared_step < 1e-26 * (1.0 + q.squaredNorm())) break;
    const Eigen::Vector2d step = J.inverse() * (d - Eigen::Vector2d(map.d[0], map.d[1]));
    squared_step = step.squaredNorm();
    q += step;
  }
  const double tolerance = 1e-18 * (1.0 + q.squaredNorm());
  if (!(squared_step <= tolerance) || !Grows(p, extra, q.norm())) return std::nullopt;
  return q;
}

}  // namespace

PlaneMap Distort(const Polynomial& p, const double* extra, const double* q,
                 const ExtraRows* J_extra) {
  PlaneMap out;
  RadialPart(p, extra, q, J_extra, &out);
  if (!p.is_two_steps) {
    AddDecentering(p, extra, q, J_extra, &out);
    return out;
  }
  PlaneMap second{{out.d[0], out.d[1]}, {1.0, 0.0, 0.0, 1.0}};
  AddDecentering(p, extra, out.d, J_extra, &second);
  Chain(second, out.J, out.J + 2, 2);
  if (J_extra) Chain(second, (*J_extra)[0], (*J_extra)[1], p.num_radial);
  std::copy_n(second.d, 2, out.d);
  return out;
}

std::optional<Eigen::Vector2d> Undistort(const Polynomial& p, const double* extra,
                                         const Eigen::Vector2d& d, double max_r) {
  std::optional<Eigen::Vector2d> q = d;
  if (p.num_radial > 0) {
    q = SolveForPoint(p, extra, d, d);
    // It may have stepped across a fold, to a branch that shows nothing.
    if (!q && d.norm() > 0.0) {
      const double r = UndistortRadius(p, extra, d.norm(), max_r);
      q = SolveForPoint(p, extra, d, d * (r / d.norm()));
    }
  }
  return q && q->norm() <= max_r ? q : std::nullopt;
}

}  // namespace cairn::internal
