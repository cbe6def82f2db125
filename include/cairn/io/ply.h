#pragma once

#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

struct PlyOptions {
  bool points = true;
  // Camera centers (red) and frusta (edges to the image's four corners, as `edge` elements).
  bool cameras = true;
  // Depth of the frusta in world units; 0: a fifth of the median distance between a camera and its
  // nearest neighbor.
  double frustum_depth = 0;
};

// Binary little-endian PLY: vertices with float x y z and uchar red green blue, then edges. Throws
// IoError.
void WritePly(const Reconstruction& reconstruction, const std::string& path,
              const PlyOptions& options = {});

}  // namespace cairn
