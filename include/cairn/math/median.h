#pragma once

#include <algorithm>
#include <vector>

namespace cairn {

// The median of |x| of a normal distribution, in standard deviations.
inline constexpr double kNormalMedian = 0.6745;

// The element of rank n/2 (the upper one of two middle ones); 0 if there is none.
inline double UpperMedian(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace cairn
