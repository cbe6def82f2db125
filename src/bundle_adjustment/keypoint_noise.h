#pragma once

#include <map>
#include <vector>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// The noise of keypoint positions. A detector finds a blob on the grid of its own scale, so that
// large features are located less exactly than small ones: sigma^2 = floor_px^2 + (per_scale *
// scale)^2, one coordinate, pixels, where scale is the shorter axis of the keypoint's frame (the
// scale of the detection; affine adaptation only lengthens the other axis).
struct KeypointNoise {
  double floor_px = 1.0;
  double per_scale = 0.0;

  double SigmaPx(double scale) const;
};

// By image, one a keypoint.
using KeypointScales = std::map<image_t, std::vector<float>>;

// The noise estimated from a reconstruction's reprojection errors: medians over keypoints of
// similar scale, corrected for the degrees of freedom of the points, which reduce the errors of
// short tracks. With fewer than a few hundred observations it is 1 pixel for all.
KeypointNoise EstimateKeypointNoise(const Reconstruction& reconstruction,
                                    const KeypointScales& scales, int num_threads = 1);

}  // namespace cairn
