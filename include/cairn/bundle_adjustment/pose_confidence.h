#pragma once

#include <map>

#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// How well an image's observations determine its pose.
struct PoseConfidence {
  int num_points = 0;
  // Standard deviations (root of the sum of the variances of three axes); infinite where the points
  // leave an axis open: positions of an image whose points only one other sees.
  double rotation_sigma_deg = 0;
  double position_sigma = 0;  // world units
};

// From the diagonal blocks of the reduced camera system: the covariance of each pose with the
// points free and the other cameras constant, for observations with RegisteredImage::sigmas_px. A
// lower bound, linear in the observations: errors that many cameras share do not show in it. The
// result does not depend on run.num_threads.
std::map<image_t, PoseConfidence> EstimatePoseConfidence(const Reconstruction& reconstruction,
                                                         const RunContext& run = {});

}  // namespace cairn
