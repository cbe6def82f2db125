#pragma once

#include <Eigen/Core>

#include "cairn/base/rng.h"

// Vectors of random numbers, the last of which is drawn first. (Compilers order the draws that are
// arguments of one call as they like.)
namespace cairn {

// Standard normal numbers.
template <int N>
Eigen::Vector<double, N> GaussianVector(Rng& rng) {
  Eigen::Vector<double, N> v;
  for (int k = N; k-- > 0;) v[k] = rng.Gaussian();
  return v;
}

struct UniformRange {
  double min, max;
};

// Uniform numbers, each in its range.
template <int N>
Eigen::Vector<double, N> UniformVector(const UniformRange (&ranges)[N], Rng& rng) {
  Eigen::Vector<double, N> v;
  for (int k = N; k-- > 0;) v[k] = rng.Uniform(ranges[k].min, ranges[k].max);
  return v;
}

}  // namespace cairn
