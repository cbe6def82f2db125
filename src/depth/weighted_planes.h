#pragma once

#include <array>
#include <vector>

#include "cairn/depth/depth_map.h"

namespace cairn {

// v = value + gradient . (p - position), in map pixels (the map's top-left pixel has its center at
// (0.5, 0.5)).
struct LocalPlane {
  double value = 0;
  double gradient_x = 0;
  double gradient_y = 0;
};

// Planes fitted to a scalar map by least squares with Gaussian weights around any point, over the
// valid pixels alone (normalized convolution of first order; Knutsson and Westin 1993). All moments
// are blurred once over the map; an exact plane is found exactly, next to holes and the border too.
class WeightedPlanes {
 public:
  // sigma: standard deviation of the weights in map pixels, along x and y. At least half a pixel
  // is used.
  WeightedPlanes(const DepthMap& map, const std::vector<double>& values, double sigma_x,
                 double sigma_y);

  // The plane around (x, y), or false where the valid pixels fix none.
  bool Fit(double x, double y, LocalPlane* plane) const;

 private:
  // Weighted sums of 1, x, y, x^2, xy, y^2, v, vx, vy; x and y in map pixels from the map's center.
  static constexpr int kNumMoments = 9;
  using Moments = std::array<double, kNumMoments>;

  int cells_x_ = 0, cells_y_ = 0;
  int cell_width_ = 1, cell_height_ = 1;  // map pixels per cell
  double center_x_ = 0, center_y_ = 0;    // map pixels
  std::vector<Moments> moments_;          // cells_y x cells_x
};

}  // namespace cairn
