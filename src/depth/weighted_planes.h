#pragma once

#include <array>
#include <vector>

#include "cairn/depth/depth_map.h"

namespace cairn {

// v = value at a point, and its gradient, in map pixels (the map's top-left pixel has its center at
// (0.5, 0.5)).
struct LocalPlane {
  double value = 0;
  double gradient_x = 0;
  double gradient_y = 0;
};

// Planes fitted to the values of a map by least squares with Gaussian weights around any point,
// over the valid pixels alone (normalized convolution of first order; Knutsson and Westin 1993). An
// exact plane is found exactly, next to holes and the border too. For a wide window the pixels are
// first gathered in cells that keep their moments, so that a fit looks at a few hundred cells at
// most.
class WeightedPlanes {
 public:
  // sigma: standard deviation of the weights in map pixels, along x and y; at least 0.7 is used.
  // `map` must outlive this object.
  WeightedPlanes(const DepthMap& map, double sigma_x, double sigma_y);

  // The plane around (x, y), or false where the valid pixels fix none.
  bool Fit(double x, double y, LocalPlane* plane) const;

 private:
  // Weighted sums of 1, x, y, x^2, xy, y^2, v, vx, vy; x and y in map pixels from the map's center.
  static constexpr int kNumMoments = 9;
  using Moments = std::array<double, kNumMoments>;

  // Cells first .. first + weights.size() - 1 of one axis, and their Gaussian weights.
  struct Window {
    int first = 0;
    std::vector<double> weights;
  };
  static Window MakeWindow(double position, double sigma, int cell_size, int num_cells);
  Moments PixelMoments(int column, int row) const;
  Moments WindowMoments(double x, double y) const;

  const DepthMap* map_;
  double sigma_x_, sigma_y_;
  int cell_width_, cell_height_;  // map pixels per cell
  int cells_x_, cells_y_;
  std::vector<Moments> cells_;  // cells_y x cells_x; empty where a cell is a pixel
};

}  // namespace cairn
