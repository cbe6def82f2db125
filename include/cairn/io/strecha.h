#pragma once

#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// Reads a folder of Strecha's ground truth, `<image name>.camera` each (src/io/FORMATS.md), as
// PINHOLE cameras (principal points + 0.5: there the center of the top-left pixel is 0) of the size
// stated in the file, and images with the ids 1, 2, ... in the order of their names. Throws IoError
// that names the file.
Reconstruction ReadStrecha(const std::string& folder);

// Whether the folder holds at least one .camera file.
bool IsStrechaFolder(const std::string& folder);

}  // namespace cairn
