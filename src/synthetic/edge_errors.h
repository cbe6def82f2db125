#pragma once

#include <vector>

#include "cairn/base/rng.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/synthetic/poses.h"

namespace cairn {

// Errors of edges, as angles in radians. At heavy_tail = 0 their distribution is near Rayleigh's.
// At 1 it is log-normal with the spread that the real edges of 1DSfM's Ellis Island have around
// their median (2.9 degrees; a tenth of the edges is off by more than 37 degrees), where bad
// photographs have many bad edges and most errors turn around the image's x and y axes.
class EdgeErrors {
 public:
  EdgeErrors(const EdgeNoise& noise, int num_images, Rng& rng);

  // Of the pair of images i and j (indices from 0).
  void Perturb(size_t i, size_t j, Rng& rng, Rigid3d* cam2_from_cam1) const;

 private:
  double Angle(double median_deg, double z) const;

  EdgeNoise noise_;
  std::vector<double> badness_;
};

// Inliers of an edge that means nothing.
int NumChanceInliers(Rng& rng);

}  // namespace cairn
