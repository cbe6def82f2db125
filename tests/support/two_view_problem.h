#pragma once

#include <cstdint>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/scene/features.h"
#include "cairn/synthetic/surface.h"

namespace cairn {

enum class TwoViewLayout {
  kPaper,   // the paper's setup: f = 600, 600 x 600 px, cameras at distance 1-2 around the origin,
            // points from N(0, I) with random normals; points may lie outside the images
  kRelief,  // a rough wall, all points within both images
  kPlane,   // the same wall without relief
};

struct TwoViewProblemOptions {
  TwoViewLayout layout = TwoViewLayout::kRelief;
  int num_matches = 500;
  double outlier_ratio = 0;        // share of wrong matches, [0, 1]
  double baseline_angle_deg = 15;  // at the wall's center (not kPaper)
  ObservationNoise noise = {};
  double missing_depth_ratio = 0;  // share of keypoints without depth
  double depth1_scale = 1.0;       // units of the first depth map per world unit
  double depth2_scale = 1.0;       // ... of the second
};

// Two cameras that look at the same surface, with keypoints, depth and matches.
struct TwoViewProblem {
  Camera camera1, camera2;  // PINHOLE; principal point at the image center
  Rigid3d cam1_from_world, cam2_from_world;
  Rigid3d cam2_from_cam1;  // translation in world units, not normalized
  // depth2_scale / depth1_scale: with both depth maps in their own units, x_2 = depth_ratio R x_1 +
  // t, t = depth2_scale * translation.
  double depth_ratio = 1.0;
  std::vector<SurfaceElement> elements;  // of the correct matches, in the order of the matches
  // Exact observations, before noise: of match i in the first and the second image. For a wrong
  // match they show different elements.
  std::vector<AffineObservation> exact1, exact2;
  // The same with noise, in keypoint order (match i joins keypoint matches[i].point1 and .point2).
  std::vector<AffineObservation> observations1, observations2;
  std::vector<Keypoint> keypoints1, keypoints2;  // float versions of observations
  std::vector<DepthSample> depth1, depth2;
  FeatureMatches matches;
  std::vector<bool> is_inlier;  // one a match
};

// The same seed and options give the same problem. Keypoint order is shuffled, so that match i does
// not join keypoints i.
TwoViewProblem MakeTwoViewProblem(const TwoViewProblemOptions& options, uint64_t seed);

}  // namespace cairn
