#pragma once

#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// Writes nerfstudio's transforms.json: per image intrinsics (OPENCV model, of which all of cairn's
// cameras are special cases) and camera-to-world in OpenGL's camera frame (x right, y up, z
// backward), world as it is. `image_folder` is written before each image's name; `ply_path` ("":
// none) names the points' PLY file. Both are as nerfstudio wants them: relative to the json file.
// Throws IoError.
void WriteTransformsJson(const Reconstruction& reconstruction, const std::string& path,
                         const std::string& image_folder, const std::string& ply_path = "");

}  // namespace cairn
