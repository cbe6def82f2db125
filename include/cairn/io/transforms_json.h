#pragma once

#include <string>
#include <vector>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// Writes nerfstudio's transforms.json: per image intrinsics (of the one model that the file has, by
// the first image: OPENCV, OPENCV_FISHEYE or EQUIRECTANGULAR) and camera-to-world in OpenGL's
// camera frame (x right, y up, z backward), world as it is (applied_transform: the identity).
// `image_folder` is written before each image's name; `ply_path` ("": none) names the points' PLY
// file. Both are as nerfstudio wants them: relative to the json file. Returns a warning for each
// camera model that the file cannot hold. Throws IoError.
std::vector<std::string> WriteTransformsJson(const Reconstruction& reconstruction,
                                             const std::string& path,
                                             const std::string& image_folder,
                                             const std::string& ply_path = "");

}  // namespace cairn
