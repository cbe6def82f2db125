#pragma once

#include <array>
#include <memory>
#include <vector>

#include "cairn/image/bitmap.h"

namespace cairn {

// A gray image of floats. Rows are padded to whole blocks of 16, so that kernels need no tails; no
// value is set.
struct Plane {
  Plane() = default;
  Plane(int width, int height);
  float* Row(int y) { return data.get() + static_cast<size_t>(y) * stride; }
  const float* Row(int y) const { return data.get() + static_cast<size_t>(y) * stride; }

  int width = 0, height = 0, stride = 0;
  std::shared_ptr<float[]> data;  // copies of a plane share it
};

// Images of one resolution with more and more blur: level l has kBaseSigma * 2^(l / kLevels) of an
// octave's pixels. The difference of levels l and l + 1 has its extrema in levels 1 to kLevels.
struct Octave {
  static constexpr int kLevels = 3;
  static constexpr double kBaseSigma = 1.6 * 0.7937005259840998;  // 1.6 * 2^(-1 / 3)

  double Sigma(double level) const;  // in pixels of the image

  double pixel_size = 1;  // in pixels of the image; pixel i lies at pixel_size * i of the image's
  std::array<Plane, kLevels + 3> levels;
};

// The Gaussian scale space of an image (Lowe, IJCV 2004, section 3). Octave o has pixels of 2^o of
// the image's; -1 is the image doubled. An octave is built when it is asked for, so that the finest
// ones, which cost most, cost nothing where the coarse ones have features enough.
class ScaleSpace {
 public:
  explicit ScaleSpace(const Bitmap& gray);

  int last_octave() const { return static_cast<int>(bases_.size()) - 1; }
  Octave Build(int octave) const;

 private:
  Plane image_;               // values from 0 to 1
  std::vector<Plane> bases_;  // level 0 of octaves 0, 1, ...
};

}  // namespace cairn
