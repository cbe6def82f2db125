#pragma once

#include <limits>
#include <span>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/scene/features.h"

namespace cairn {

// One image of a pair, with its depth sampled at several scales (at least one).
struct DepthWitness {
  const Camera* camera = nullptr;
  std::span<const Keypoint> keypoints;
  std::span<const std::vector<DepthSample>> scales;  // each with a sample a keypoint
};

// An image's depth can be read at any of its scales, as it is or with its inverse shifted. Reading
// k < number of scales: scale k as it is; the others: scale k - number of scales, shifted.
//
// What the pose and inliers of a verified pair tell about the depth of its images.
struct DepthEvidence {
  // What is to be added to an image's inverse depth (in its own unit) to make it proportional to
  // the triangulated one, and the standard deviation; infinite: the pair does not tell.
  struct Shift {
    double value = 0.0;
    double sigma = std::numeric_limits<double>::infinity();
  };
  Shift shift1, shift2;
  int num_readings1 = 0, num_readings2 = 0;
  int num_samples = 0;  // inliers that were looked at, all with depth in both images
  // One for each reading of image 1 and of image 2 (row-major): the samples whose 1AC+D hypothesis
  // is within 20 degrees of the pair's rotation and 15 of its translation direction, from where
  // local optimization reaches it (paper, appendix). Shifted: each image by the pair's own shift.
  std::vector<int> num_right;

  int NumRight(int reading1, int reading2) const {
    return num_right[reading1 * num_readings2 + reading2];
  }
};

// Looks at up to 40 inliers, evenly over their order. The shift comes from a robust line (least
// absolute deviations) of sampled over triangulated inverse depth: in this direction noise of the
// sampled depth does not bias it. cam2_from_cam1 has a translation. About 50 microseconds.
DepthEvidence CollectDepthEvidence(const DepthWitness& image1, const DepthWitness& image2,
                                   std::span<const FeatureMatch> inliers,
                                   const Rigid3d& cam2_from_cam1);

}  // namespace cairn
