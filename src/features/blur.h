#pragma once

#include "features/scale_space.h"

namespace cairn {

// Convolves with a Gaussian of sigma pixels, cut off at 4 sigma; the image goes on beyond its
// border as it ends there. Step 2 keeps every second pixel of every second row. The same bytes on
// every instruction set.
Plane Blur(const Plane& source, double sigma, int step = 1);

}  // namespace cairn
