#pragma once

#include <cmath>

namespace cairn {

// Natural logarithm of the binomial coefficient "n over k".
inline double LogBinomial(int n, int k) {
  const auto log_factorial = [](int m) {
    int sign;  // std::lgamma writes a global one
    return lgamma_r(m + 1.0, &sign);
  };
  return log_factorial(n) - log_factorial(k) - log_factorial(n - k);
}

}  // namespace cairn
