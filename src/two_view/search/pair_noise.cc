#include "two_view/search/pair_noise.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace cairn::internal {

double NoiseScalePx(const PreparedPair& pair, const std::vector<float>& errors_px, double factor,
                    std::vector<float>* scratch) {
  constexpr double kMinNoise = 0.25;
  constexpr double kNumParameters = 5.0;  // of a pose
  constexpr double kPriorWeight = 10.0;   // matches
  scratch->clear();
  const double max_noise_px = kMaxNoise * pair.max_error_px;
  for (int i = 0; i < pair.size(); ++i) {
    if (errors_px[i] < max_noise_px) scratch->push_back(errors_px[i]);
  }
  const double by_chance = pair.chance_per_px * max_noise_px * pair.size();
  const double num_right = static_cast<double>(scratch->size()) - by_chance;
  if (!(num_right > 2.0 * kNumParameters)) return pair.max_error_px;
  const auto middle = scratch->begin() + static_cast<ptrdiff_t>(0.5 * num_right);
  std::nth_element(scratch->begin(), middle, scratch->end());
  const double noise_px = factor * (1.0 + 5.0 / (num_right - kNumParameters)) * *middle;
  const double mean_square =
      (kPriorWeight * pair.max_error_px * pair.max_error_px + num_right * noise_px * noise_px) /
      (kPriorWeight + num_right);
  return std::clamp(std::sqrt(mean_square), kMinNoise * pair.max_error_px, max_noise_px);
}

}  // namespace cairn::internal
