#pragma once

#include <cstdint>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

inline const RunContext kOneThread{.num_threads = 1};

struct SyntheticOptions {
  int num_images = 6;
  int num_points = 200;
  double noise_px = 0;
  double outlier_share = 0;  // of the observations; moved by 20 to 200 pixels
  double visible_share = 0.8;
  CameraModel model = CameraModel::kPinhole;
  bool shared_camera = true;
  uint64_t seed = 0;
};

struct MadeReconstruction {
  Reconstruction truth;  // with exact poses, cameras and points, and the observations as measured
  std::vector<Track> tracks;
};

// Cameras on an arc about points in a box near the origin, keypoints as the truth (or noise) has
// them; every track holds at least two observations.
MadeReconstruction MakeSyntheticScene(const SyntheticOptions& options);

// Largest distance of camera centers, and largest angle (radians) of rotations, after the best
// similarity alignment of the estimate to the truth.
struct PoseDifference {
  double center = 0;
  double angle = 0;
};
PoseDifference CompareAligned(const Reconstruction& estimate, const Reconstruction& truth);

}  // namespace cairn
