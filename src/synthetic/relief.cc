#include "synthetic/relief.h"

#include <cmath>
#include <numbers>

namespace cairn {

Relief::Relief(Rng& rng) {
  for (Wave& wave : waves_) {
    wave.amplitude = 1.0 / waves_.size();
    wave.u = 1.0 + rng.UniformInt(6);
    wave.v = rng.Uniform(-6.0, 6.0);
    wave.phase = rng.Uniform(0.0, 2.0 * std::numbers::pi);
  }
}

double Relief::Value(double u, double v, Eigen::Vector2d* gradient) const {
  double h = 0;
  gradient->setZero();
  for (const Wave& wave : waves_) {
    const double angle = wave.u * u + wave.v * v + wave.phase;
    h += wave.amplitude * std::sin(angle);
    *gradient += wave.amplitude * std::cos(angle) * Eigen::Vector2d(wave.u, wave.v);
  }
  return h;
}

SurfaceElement SampleWall(const Relief& relief, double amplitude, double half_length, double size,
                          Rng& rng) {
  const double u = half_length * rng.Uniform(-1.0, 1.0);
  const double v = rng.Uniform(-0.75, 0.75);
  Eigen::Vector2d dh;
  const double h = amplitude * relief.Value(u, v, &dh);
  dh *= amplitude;
  const Eigen::Vector3d normal(-dh.x(), -1.0, -dh.y());  // of y + h(x, z) = 0, towards the front
  return MakeSurfaceElement({u, -h, v}, normal, size, rng.Uniform(0.0, 2.0 * std::numbers::pi));
}

SurfaceElement SampleTower(const Relief& relief, double amplitude, double size, Rng& rng) {
  const double u = rng.Uniform(-std::numbers::pi, std::numbers::pi);
  const double v = rng.Uniform(-0.75, 0.75);
  Eigen::Vector2d dr;
  const double r = 0.8 + amplitude * relief.Value(u, v, &dr);
  dr *= amplitude;
  const double c = std::cos(u);
  const double s = std::sin(u);
  const Eigen::Vector3d du(dr.x() * c - r * s, dr.x() * s + r * c, 0.0);
  const Eigen::Vector3d dv(dr.y() * c, dr.y() * s, 1.0);
  return MakeSurfaceElement({r * c, r * s, v}, du.cross(dv), size,
                            rng.Uniform(0.0, 2.0 * std::numbers::pi));
}

}  // namespace cairn
