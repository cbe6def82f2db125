#pragma once

#include <cstdint>

#include "features/patch.h"

namespace cairn {

// RootSIFT (Arandjelovic and Zisserman 2012): divides by the sum of absolute values and takes
// square roots, so that the result has unit Euclidean length; stored as min(255, round(512 x)), as
// COLMAP does. A zero histogram stays zero.
void WriteRootSift(const float* histogram, uint8_t* descriptor);

}  // namespace cairn
