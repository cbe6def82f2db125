#pragma once

#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// Cameras of a Bundler file have no size, and their keypoints are relative to the image center.
// Gives them the size of their photograph under image_path, the principal point in its center, and
// moves the keypoints. Throws ConfigError where image_path is "", IoError where a photograph cannot
// be read.
void CompleteImageSizes(const std::string& image_path, Reconstruction& reconstruction);

}  // namespace cairn
