#include "camera/polynomial_distortion.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::internal {
namespace {

double Coefficient(const double* extra, int index) { return index < 0 ? 0.0 : extra[index]; }

// N and D of the radial factor and their derivatives by r2.
struct Radial {
  double n = 1.0, d = 1.0, dn = 0.0, dd = 0.0;
  double Factor() const { return n / d; }
  double Slope() const { return (dn * d - n * dd) / (d * d); }  // d(factor)/d(r2)
};

Radial RadialAt(const Polynomial& p, const double* extra, double r2) {
  Radial out;
  double power = 1.0;  // r2^i
  for (int i = 0; i < std::max(p.num_radial, p.num_denominator); ++i) {
    const double n = i < p.num_radial ? extra[p.radial[i]] : 0.0;
    const double d = i < p.num_denominator ? extra[p.denominator[i]] : 0.0;
    out.dn += (i + 1) * n * power;
    out.dd += (i + 1) * d * power;
    power *= r2;
    out.n += n * power;
    out.d += d * power;
  }
  return out;
}

// q times the radial factor.
void RadialPart(const Polynomial& p, const double* extra, const double* q, bool derive_extra,
                PlaneMap* out) {
  const double r2 = q[0] * q[0] + q[1] * q[1];
  const Radial radial = RadialAt(p, extra, r2);
  const double factor = radial.Factor(), slope = 2.0 * radial.Slope();
  for (int i = 0; i < 2; ++i) {
    out->d[i] = q[i] * factor;
    for (int j = 0; j < 2; ++j) out->J[2 * i + j] = (i == j ? factor : 0.0) + slope * q[i] * q[j];
  }
  if (!derive_extra) return;
  double power = 1.0;
  for (int k = 0; k < std::max(p.num_radial, p.num_denominator); ++k) {
    power *= r2;
    for (int i = 0; i < 2; ++i) {
      if (k < p.num_radial) out->extra[i][p.radial[k]] = q[i] * power / radial.d;
      if (k < p.num_denominator) {
        out->extra[i][p.denominator[k]] = -q[i] * power * factor / radial.d;
      }
    }
  }
}

// Tangential part and thin prism of q: added to d, J and the derivatives by extra parameters.
void AddDecentering(const Polynomial& p, const double* extra, const double* q, bool derive_extra,
                    PlaneMap* out) {
  if (p.p1 < 0) return;
  const double u = q[0], v = q[1];
  const double uu = u * u, vv = v * v, uv = u * v, r2 = uu + vv;
  const double p1 = extra[p.p1], p2 = extra[p.p2];
  const double sx = Coefficient(extra, p.sx), sy = Coefficient(extra, p.sy);
  const double sx2 = Coefficient(extra, p.sx2), sy2 = Coefficient(extra, p.sy2);
  out->d[0] += 2.0 * p1 * uv + p2 * (r2 + 2.0 * uu) + (sx + sx2 * r2) * r2;
  out->d[1] += 2.0 * p2 * uv + p1 * (r2 + 2.0 * vv) + (sy + sy2 * r2) * r2;
  const double dx = 2.0 * (sx + 2.0 * sx2 * r2), dy = 2.0 * (sy + 2.0 * sy2 * r2);
  out->J[0] += 2.0 * p1 * v + 6.0 * p2 * u + dx * u;
  out->J[1] += 2.0 * p1 * u + 2.0 * p2 * v + dx * v;
  out->J[2] += 2.0 * p2 * v + 2.0 * p1 * u + dy * u;
  out->J[3] += 2.0 * p2 * u + 6.0 * p1 * v + dy * v;
  if (!derive_extra) return;
  out->extra[0][p.p1] = 2.0 * uv;
  out->extra[1][p.p1] = r2 + 2.0 * vv;
  out->extra[0][p.p2] = r2 + 2.0 * uu;
  out->extra[1][p.p2] = 2.0 * uv;
  if (p.sx >= 0) out->extra[0][p.sx] = r2;
  if (p.sy >= 0) out->extra[1][p.sy] = r2;
  if (p.sx2 >= 0) out->extra[0][p.sx2] = r2 * r2;
  if (p.sy2 >= 0) out->extra[1][p.sy2] = r2 * r2;
}

// The second of two steps: d(second)/d(first) times what the first gave.
void Chain(const PlaneMap& second, PlaneMap* first) {
  const double J[4] = {first->J[0], first->J[1], first->J[2], first->J[3]};
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      first->J[2 * i + j] = second.J[2 * i] * J[j] + second.J[2 * i + 1] * J[2 + j];
    }
  }
  for (int k = 0; k < 12; ++k) {
    const double a = first->extra[0][k], b = first->extra[1][k];
    for (int i = 0; i < 2; ++i) {
      first->extra[i][k] = second.extra[i][k] + second.J[2 * i] * a + second.J[2 * i + 1] * b;
    }
  }
  first->d[0] = second.d[0];
  first->d[1] = second.d[1];
}

// Radius after the radial part, and its derivative.
struct RadiusMap {
  double value, slope;
};

RadiusMap RadiusAt(const Polynomial& p, const double* extra, double r) {
  const Radial radial = RadialAt(p, extra, r * r);
  if (!(radial.d > 0.0)) return {0.0, -1.0};  // beyond a pole nothing is meant
  return {r * radial.Factor(), radial.Factor() + 2.0 * r * r * radial.Slope()};
}

// Does the distorted radius grow all the way to r? Lenses are smooth: so many samples show a fold.
bool Grows(const Polynomial& p, const double* extra, double r) {
  constexpr int kNumSamples = 16;
  for (int k = 1; k <= kNumSamples; ++k) {
    if (!(RadiusAt(p, extra, r * k / kNumSamples).slope > 0.0)) return false;
  }
  return true;
}

// The radius below max_r, on the first branch on which the distorted one grows, whose distorted one
// is `target`; NaN if there is none.
double UndistortRadius(const Polynomial& p, const double* extra, double target, double max_r) {
  if (target == 0.0) return 0.0;
  double r = std::min(target, max_r);
  for (int i = 0; i < 20; ++i) {
    const RadiusMap map = RadiusAt(p, extra, r);
    if (!(map.slope > 0.0)) break;
    const double step = (target - map.value) / map.slope;
    r = std::clamp(r + step, 0.0, max_r);
    if (std::abs(step) < 1e-14 * (1.0 + r)) {
      const double error = std::abs(RadiusAt(p, extra, r).value - target);
      if (error < 1e-10 * (1.0 + target) && Grows(p, extra, r)) return r;
      break;
    }
  }
  // Step by step, until the target is passed or the growth ends; then bisection.
  constexpr int kNumSteps = 256;
  double low = 0.0;
  const double last = std::isfinite(max_r) ? max_r : 64.0;
  for (int k = 1; k <= kNumSteps; ++k) {
    // Finer near the center where there is no largest radius.
    const double t = static_cast<double>(k) / kNumSteps;
    double high = last * (std::isfinite(max_r) ? t : t * t);
    const RadiusMap map = RadiusAt(p, extra, high);
    if (map.slope > 0.0 && map.value < target) {
      low = high;
      continue;
    }
    for (int i = 0; i < 100; ++i) {
      const double middle = 0.5 * (low + high);
      const RadiusMap at = RadiusAt(p, extra, middle);
      (at.slope > 0.0 && at.value < target ? low : high) = middle;
    }
    const RadiusMap at = RadiusAt(p, extra, low);
    return at.slope > 0.0 && std::abs(at.value - target) < 1e-9 * (1.0 + target)
               ? low
               : std::numeric_limits<double>::quiet_NaN();
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

PlaneMap Distort(const Polynomial& p, const double* extra, const double* q, bool derive_extra) {
  PlaneMap out{};
  RadialPart(p, extra, q, derive_extra, &out);
  if (!p.is_two_steps) {
    AddDecentering(p, extra, q, derive_extra, &out);
    return out;
  }
  PlaneMap second{};
  second.d[0] = out.d[0];
  second.d[1] = out.d[1];
  second.J[0] = second.J[3] = 1.0;
  AddDecentering(p, extra, out.d, derive_extra, &second);
  Chain(second, &out);
  return out;
}

std::optional<Eigen::Vector2d> Undistort(const Polynomial& p, const double* extra,
                                         const Eigen::Vector2d& d, double max_r) {
  const double target = d.norm();
  const double r = UndistortRadius(p, extra, target, max_r);
  if (std::isnan(r)) return std::nullopt;
  Eigen::Vector2d q = target > 0.0 ? Eigen::Vector2d(d * (r / target)) : d;
  if (p.p1 < 0) return q;
  for (int iteration = 0; iteration < 50; ++iteration) {
    const PlaneMap map = Distort(p, extra, q.data(), false);
    const double det = map.J[0] * map.J[3] - map.J[1] * map.J[2];
    // Where the distortion folds over, the model has no inverse.
    if (!(det > 1e-3) || !(RadiusAt(p, extra, q.norm()).slope > 0.0)) return std::nullopt;
    const Eigen::Vector2d e(d[0] - map.d[0], d[1] - map.d[1]);
    const Eigen::Vector2d step((map.J[3] * e[0] - map.J[1] * e[1]) / det,
                               (map.J[0] * e[1] - map.J[2] * e[0]) / det);
    q += step;
    if (!(q.norm() < 2.0 * max_r)) return std::nullopt;
    if (step.squaredNorm() < 1e-26 * (1.0 + q.squaredNorm())) {
      return q.norm() <= max_r ? std::optional(q) : std::nullopt;
    }
  }
  return std::nullopt;
}

}  // namespace cairn::internal
