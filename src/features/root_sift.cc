#include "features/root_sift.h"

#include <algorithm>
#include <cmath>

namespace cairn {

void WriteRootSift(const float* histogram, uint8_t* descriptor) {
  double sum = 0;
  for (int i = 0; i < kSiftDim; ++i) sum += std::abs(histogram[i]);
  const double factor = sum > 0 ? 1.0 / sum : 0.0;
  for (int i = 0; i < kSiftDim; ++i) {
    const double root = std::sqrt(std::abs(histogram[i]) * factor);
    descriptor[i] = static_cast<uint8_t>(std::min(255.0, std::floor(512.0 * root + 0.5)));
  }
}

}  // namespace cairn
