#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "cairn/bundle_adjustment/bundle_adjustment.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

struct BundleObservation {
  Eigen::Vector2d pixel;
  float precision;
  int image;
};

// Those of points in front of their cameras: of the reconstruction's points, then of surveyed ones.
// Images and points are numbered in the order of their ids.
struct BundleObservations {
  std::vector<BundleObservation> all;  // point by point, of each in the order of images
  std::vector<int> begin{0};           // of each point
  std::vector<int> point_of;           // of each observation
  std::vector<std::vector<int>> of_image;
  int num_unsurveyed = 0;  // points

  int NumPoints() const { return static_cast<int>(begin.size()) - 1; }
  // Those of the reconstruction.
  int NumUnsurveyed() const { return begin[num_unsurveyed]; }
};

BundleObservations CollectObservations(const BundleAdjustmentScope& scope,
                                       const Reconstruction& reconstruction, int num_threads);

// By image, the images from it on that see a point together with it, ascending, itself first
// (CameraSystem).
std::vector<std::vector<int>> ImagesSeenTogether(const BundleObservations& observations,
                                                 int num_threads);

}  // namespace cairn
