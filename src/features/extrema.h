#pragma once

#include <vector>

#include "cairn/features/features.h"
#include "features/scale_space.h"

namespace cairn {

// A local extremum of the difference of Gaussians over position and scale.
struct Extremum {
  double x = 0, y = 0;    // in the octave's pixels
  double level = 0;       // of the octave
  double value = 0;       // the difference there, image values from 0 to 1
  float pixel_value = 0;  // of the pixel that it was found at

  // Would FindExtrema find it with this threshold?
  bool Reaches(double peak_threshold) const;
};

// Extrema among their 26 neighbors, refined by a quadric, of at least options.peak_threshold and
// without edges (options.edge_threshold); Lowe, IJCV 2004, sections 3.1 and 4.
std::vector<Extremum> FindExtrema(const Octave& octave, const FeatureOptions& options);

}  // namespace cairn
