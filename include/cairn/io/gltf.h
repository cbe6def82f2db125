#pragma once

#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// Binary glTF 2.0 (.glb): the points with their colors, the cameras' frusta as lines, and a camera
// node for each image, under its name (panoramas: a node alone). World as it is; cameras in glTF's
// frame (x right, y up, z backward). Throws IoError.
void WriteGltf(const Reconstruction& reconstruction, const std::string& path);

}  // namespace cairn
