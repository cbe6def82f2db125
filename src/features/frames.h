#pragma once

#include <Eigen/Core>
#include <vector>

#include "cairn/features/features.h"
#include "features/extrema.h"
#include "features/patch.h"
#include "features/scale_space.h"

namespace cairn {

// A keypoint that is not described yet. M's columns are its axes in pixels of the image.
struct Frame {
  Eigen::Vector2d center;  // in the octave's pixels
  double sigma = 0;        // where it was detected, in pixels of the image
  double response = 0;     // absolute value of the difference of Gaussians
  bool is_bright = false;  // brighter inside than around
  Eigen::Matrix2d M;
};

// Where an image has no features: where the mask, which may be finer than the image, is 0.
struct Masked {
  const Bitmap* mask = nullptr;     // none: nowhere
  double scale_x = 1, scale_y = 1;  // pixels of the mask a pixel of the image

  // pixel: of the image, the center of the top-left one is (0, 0).
  bool operator()(const Eigen::Vector2d& pixel) const;
};

// The frames of an octave's extrema that reach the peak threshold, with affine shapes and
// orientations as the options want them; the larger first, at most max_frames, none of them masked.
std::vector<Frame> FindFrames(const Octave& octave, const std::vector<Extremum>& extrema,
                              const FeatureOptions& options, const Masked& is_masked,
                              size_t max_frames);

// The gradient around a frame, read between the two levels of the pyramid whose blur is next to the
// frame's shorter axis.
PatchGradient GradientAround(const Octave& octave, const Eigen::Vector2d& center,
                             const Eigen::Matrix2d& M);

}  // namespace cairn
