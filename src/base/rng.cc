#include "cairn/base/rng.h"

#include <bit>
#include <cmath>

#include "base/hash.h"
#include "cairn/base/check.h"

namespace cairn {
namespace {

// SplitMix64 (Steele, Lea and Flood 2014): fills the state from one number.
uint64_t SplitMix(uint64_t& x) {
  uint64_t z = (x += 0x9e3779b97f4a7c15ull);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

}  // namespace

Rng::Rng(uint64_t seed, std::string_view stage, uint64_t id) {
  Hasher hasher;
  hasher.Add(seed).Add(stage).Add(id);
  uint64_t x = hasher.Digest();
  for (uint64_t& s : state_) s = SplitMix(x);
}

uint64_t Rng::NextU64() {
  const uint64_t result = std::rotl(state_[1] * 5, 7) * 9;
  const uint64_t t = state_[1] << 17;
  state_[2] ^= state_[0];
  state_[3] ^= state_[1];
  state_[1] ^= state_[2];
  state_[0] ^= state_[3];
  state_[2] ^= t;
  state_[3] = std::rotl(state_[3], 45);
  return result;
}

// Lemire 2019, "Fast random integer generation in an interval".
uint32_t Rng::UniformInt(uint32_t n) {
  CAIRN_DCHECK(n > 0);
  uint64_t m = (NextU64() >> 32) * n;
  if (static_cast<uint32_t>(m) < n) {
    const uint32_t threshold = (0u - n) % n;
    while (static_cast<uint32_t>(m) < threshold) m = (NextU64() >> 32) * n;
  }
  return static_cast<uint32_t>(m >> 32);
}

double Rng::Uniform() { return static_cast<double>(NextU64() >> 11) * 0x1.0p-53; }

double Rng::Gaussian() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_gaussian_;
  }
  double u, v, s;
  do {
    u = 2.0 * Uniform() - 1.0;
    v = 2.0 * Uniform() - 1.0;
    s = u * u + v * v;
  } while (s >= 1.0 || s == 0.0);
  const double factor = std::sqrt(-2.0 * std::log(s) / s);
  spare_gaussian_ = v * factor;
  has_spare_ = true;
  return u * factor;
}

void Rng::Sample(uint32_t n, uint32_t k, uint32_t* indices) {
  CAIRN_DCHECK(k <= n);
  for (uint32_t i = 0; i < k; ++i) {
    bool is_new = false;
    while (!is_new) {
      indices[i] = UniformInt(n);
      is_new = true;
      for (uint32_t j = 0; j < i; ++j) is_new = is_new && indices[j] != indices[i];
    }
  }
}

}  // namespace cairn
