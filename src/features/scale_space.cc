#include "features/scale_space.h"

#include <algorithm>
#include <cmath>

#include "features/blur.h"
#include "features/plane_memory.h"

namespace cairn {
namespace {

constexpr double kCameraSigma = 0.5;  // blur of the photograph itself (Lowe, section 3.3), px
constexpr int kMinOctaveSize = 16;    // smaller side, px

Plane Blurred(const Plane& source, double sigma_before, double sigma_after, int step = 1) {
  return Blur(source, std::sqrt(sigma_after * sigma_after - sigma_before * sigma_before), step);
}

// Twice the size, by linear interpolation; pixel 2 i is the source's pixel i.
Plane Doubled(const Plane& source) {
  Plane doubled(2 * source.width, 2 * source.height);
  for (int y = 0; y < doubled.height; ++y) {
    const float* above = source.Row(y / 2);
    const float* below = source.Row(std::min((y + 1) / 2, source.height - 1));
    float* row = doubled.Row(y);
    for (int x = 0; x < source.width; ++x) {
      const int right = std::min(x + 1, source.width - 1);
      row[2 * x] = 0.5f * (above[x] + below[x]);
      row[2 * x + 1] = 0.5f * (row[2 * x] + 0.5f * (above[right] + below[right]));
    }
  }
  return doubled;
}

}  // namespace

Plane::Plane(int width_, int height_)
    : width(width_),
      height(height_),
      stride((width_ + 15) / 16 * 16),
      data(AllocateFloats(static_cast<size_t>(stride) * height_)) {
  for (int y = 0; y < height; ++y) std::fill(Row(y) + width, Row(y) + stride, 0.0F);
}

double Octave::Sigma(double level) const {
  return pixel_size * kBaseSigma * std::exp2(level / kLevels);
}

ScaleSpace::ScaleSpace(const Bitmap& gray) : image_(gray.width, gray.height) {
  for (int y = 0; y < gray.height; ++y) {
    const uint8_t* row = gray.Pixel(0, y);
    std::transform(row, row + gray.width, image_.Row(y), [](uint8_t v) { return v / 255.0f; });
  }
  bases_.push_back(Blurred(image_, kCameraSigma, Octave::kBaseSigma));
  while (std::min(bases_.back().width, bases_.back().height) >= 2 * kMinOctaveSize) {
    bases_.push_back(Blurred(bases_.back(), Octave::kBaseSigma, 2 * Octave::kBaseSigma, 2));
  }
}

Octave ScaleSpace::Build(int octave) const {
  Octave result;
  result.pixel_size = std::exp2(octave);
  result.levels[0] =
      octave < 0 ? Blurred(Doubled(image_), 2 * kCameraSigma, Octave::kBaseSigma) : bases_[octave];
  for (size_t level = 1; level < result.levels.size(); ++level) {
    const double before = result.Sigma(level - 1.0) / result.pixel_size;
    const double after = result.Sigma(level) / result.pixel_size;
    result.levels[level] = Blurred(result.levels[level - 1], before, after);
  }
  return result;
}

}  // namespace cairn
