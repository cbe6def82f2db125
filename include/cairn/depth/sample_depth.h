#pragma once

#include <span>
#include <vector>

#include "cairn/depth/depth_map.h"
#include "cairn/scene/features.h"

namespace cairn {

// Depth and its gradient per image pixel at keypoints of an image_width x image_height image over
// which the map is stretched. Value and gradient come from local planes fitted with Gaussian
// weights (of the options' windows) to the valid values only, so that neither missing values nor
// the border bias them; planes of inverse depth where the map has that. A sample is invalid outside
// the image, where the map is missing and where the fit does not give a positive depth.
std::vector<DepthSample> SampleDepth(const DepthMap& map, int image_width, int image_height,
                                     std::span<const Keypoint> keypoints,
                                     const DepthOptions& options);

}  // namespace cairn
