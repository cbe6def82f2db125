#pragma once

#include <cstdint>
#include <string_view>
#include <utility>

namespace cairn {

// A small random generator (xoshiro256**, Blackman and Vigna 2018) whose numbers are the same on
// every machine and compiler; the distributions of <random> are not. Seeded by hashing (seed,
// stage, id), so that the numbers of a task depend on its item and never on the thread that runs
// it.
class Rng {
 public:
  explicit Rng(uint64_t seed, std::string_view stage = {}, uint64_t id = 0);

  uint64_t NextU64();
  // Uniform in [0, n), unbiased. n > 0.
  uint32_t UniformInt(uint32_t n);
  // Uniform in [0, 1), 53 bits.
  double Uniform();
  double Uniform(double min, double max) { return min + (max - min) * Uniform(); }
  // Standard normal (Marsaglia's polar method).
  double Gaussian();

  // k distinct indices of [0, n), written to indices[0..k). k <= n, k small (quadratic in k).
  void Sample(uint32_t n, uint32_t k, uint32_t* indices);

  // Fisher-Yates over a random-access container.
  template <class Container>
  void Shuffle(Container& values) {
    for (size_t i = values.size(); i > 1; --i) {
      std::swap(values[i - 1], values[UniformInt(static_cast<uint32_t>(i))]);
    }
  }

 private:
  uint64_t state_[4];
  double spare_gaussian_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace cairn
