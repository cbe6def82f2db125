#pragma once

#include <cstdint>

namespace cairn {

inline constexpr int kSiftDim = 128;

// RootSIFT (Arandjelovic and Zisserman 2012): divides by the sum of absolute values and takes
// square roots, so that the result has unit Euclidean length; stored as min(255, round(512 x)), as
// COLMAP does. A zero histogram stays zero.
void WriteRootSift(const float* histogram, uint8_t* descriptor);

// From VLFeat's order of the orientation bins (clockwise) to that of Lowe's binaries, which COLMAP
// stores.
void ReorderVlFeatBins(const float* vlfeat, float* lowe);

}  // namespace cairn
