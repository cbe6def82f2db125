#pragma once

#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

struct PlyOptions {
  // Camera centers (red) and frusta (edges to the image's four corners, as `edge` elements), as
  // deep as a fifth of the median distance between a camera and its nearest neighbor.
  bool cameras = true;
};

// Binary little-endian PLY: vertices with float x y z and uchar red green blue, then edges. Throws
// IoError.
void WritePly(const Reconstruction& reconstruction, const std::string& path,
              const PlyOptions& options = {});

}  // namespace cairn
