#include "synthetic/texture.h"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr int kNumOctaves = 8;
constexpr double kLongestWave = 0.8;  // world units

// Mixes a lattice cell into 32 random bits (the finalizer of SplitMix64).
uint64_t HashCell(uint64_t seed, int64_t x, int64_t y, int64_t z) {
  uint64_t h = seed + static_cast<uint64_t>(x) * 0x9e3779b97f4a7c15ull +
               static_cast<uint64_t>(y) * 0xc2b2ae3d27d4eb4full +
               static_cast<uint64_t>(z) * 0x165667b19e3779f9ull;
  h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9ull;
  h = (h ^ (h >> 27)) * 0x94d049bb133111ebull;
  return h ^ (h >> 31);
}

float CellValue(uint64_t seed, int64_t x, int64_t y, int64_t z) {
  return static_cast<float>(HashCell(seed, x, y, z) >> 40) * (2.0f / 16777215.0f) - 1.0f;
}

float Smooth(float x) { return x * x * (3.0f - 2.0f * x); }

// 0 where a wave is shorter than two footprints, 1 from four on.
float Visibility(double wavelength, double footprint) {
  return Smooth(static_cast<float>(std::clamp(0.5 * wavelength / footprint - 1.0, 0.0, 1.0)));
}

constexpr float kBaseColors[4][3] = {
    {0.58f, 0.50f, 0.42f}, {0.45f, 0.47f, 0.50f}, {0.62f, 0.45f, 0.36f}, {0.47f, 0.49f, 0.40f}};

}  // namespace

float ValueNoise(uint64_t seed, const Eigen::Vector3d& point) {
  const Eigen::Vector3d cell = point.array().floor();
  const Eigen::Vector3f f = (point - cell).cast<float>();
  const int64_t x = static_cast<int64_t>(cell.x());
  const int64_t y = static_cast<int64_t>(cell.y());
  const int64_t z = static_cast<int64_t>(cell.z());
  const float u = Smooth(f.x()), v = Smooth(f.y()), w = Smooth(f.z());
  float planes[2];
  for (int k = 0; k < 2; ++k) {
    const float a = CellValue(seed, x, y, z + k), b = CellValue(seed, x + 1, y, z + k);
    const float c = CellValue(seed, x, y + 1, z + k), d = CellValue(seed, x + 1, y + 1, z + k);
    planes[k] = (a + u * (b - a)) * (1.0f - v) + (c + u * (d - c)) * v;
  }
  return planes[0] + w * (planes[1] - planes[0]);
}

Eigen::Vector3f Texture::Color(const Eigen::Vector3d& point, int material, double footprint) const {
  float light = 0.0f;
  double wavelength = kLongestWave;
  for (int octave = 0; octave < kNumOctaves; ++octave, wavelength *= 0.5) {
    const float visibility = Visibility(wavelength, footprint);
    if (visibility == 0.0f) break;
    // Steep around zero: patches with an outline, where plain noise has only soft blobs.
    const float noise = ValueNoise(seed_ + 7919 * octave, point / wavelength);
    light += visibility * std::clamp(2.5f * noise, -1.0f, 1.0f);
  }
  light *= 0.09f;

  const double brick_height = 0.09;
  const double row = std::floor(point.z() / brick_height);
  const double shift = 0.37 * row;  // rows are offset against each other
  const float brick = CellValue(
      seed_ ^ 0xb41c, static_cast<int64_t>(std::floor(point.x() / 0.17 + shift)),
      static_cast<int64_t>(std::floor(point.y() / 0.17 + shift)), static_cast<int64_t>(row));
  light += 0.12f * brick * Visibility(0.2, footprint);

  const float tint = 0.06f * ValueNoise(seed_ + 31, point / 0.3);
  const float* base = kBaseColors[material % 4];
  return {std::clamp(base[0] + light + tint, 0.0f, 1.0f), std::clamp(base[1] + light, 0.0f, 1.0f),
          std::clamp(base[2] + light - tint, 0.0f, 1.0f)};
}

}  // namespace cairn
