#include "depth/weighted_planes.h"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr double kMinSigma = 0.7;       // map pixels; below it a corner sees hardly a second pixel
constexpr double kMinVariance = 0.01;   // squared map pixels
constexpr double kCellsPerSigma = 2.0;  // at least
constexpr double kTruncation = 3.0;     // standard deviations

}  // namespace

WeightedPlanes::WeightedPlanes(const DepthMap& map, double sigma_x, double sigma_y)
    : map_(&map),
      sigma_x_(std::max(sigma_x, kMinSigma)),
      sigma_y_(std::max(sigma_y, kMinSigma)),
      cell_width_(std::max(1, static_cast<int>(sigma_x_ / kCellsPerSigma))),
      cell_height_(std::max(1, static_cast<int>(sigma_y_ / kCellsPerSigma))),
      cells_x_((map.width + cell_width_ - 1) / cell_width_),
      cells_y_((map.height + cell_height_ - 1) / cell_height_) {
  if (cell_width_ == 1 && cell_height_ == 1) return;
  cells_.assign(static_cast<size_t>(cells_x_) * cells_y_, Moments{});
  for (int row = 0; row < map.height; ++row) {
    Moments* cells = &cells_[static_cast<size_t>(row / cell_height_) * cells_x_];
    for (int column = 0; column < map.width; ++column) {
      const Moments added = PixelMoments(column, row);
      Moments& cell = cells[column / cell_width_];
      for (int m = 0; m < kNumMoments; ++m) cell[m] += added[m];
    }
  }
}

WeightedPlanes::Moments WeightedPlanes::PixelMoments(int column, int row) const {
  const size_t pixel = static_cast<size_t>(row) * map_->width + column;
  if (!map_->is_valid[pixel]) return {};
  const double x = column + 0.5 - 0.5 * map_->width;
  const double y = row + 0.5 - 0.5 * map_->height;
  const double v = map_->values[pixel];
  return {1, x, y, x * x, x * y, y * y, v, v * x, v * y};
}

WeightedPlanes::Window WeightedPlanes::MakeWindow(double position, double sigma, int cell_size,
                                                  int num_cells) {
  const double center = position / cell_size - 0.5;
  const double radius = std::max(1.0, kTruncation * sigma / cell_size);
  Window window;
  window.first = std::max(0, static_cast<int>(std::ceil(center - radius)));
  const int last = std::min(num_cells - 1, static_cast<int>(std::floor(center + radius)));
  for (int i = window.first; i <= last; ++i) {
    const double distance = (i - center) * cell_size / sigma;
    window.weights.push_back(std::exp(-0.5 * distance * distance));
  }
  return window;
}

WeightedPlanes::Moments WeightedPlanes::WindowMoments(double x, double y) const {
  const Window columns = MakeWindow(x, sigma_x_, cell_width_, cells_x_);
  const Window rows = MakeWindow(y, sigma_y_, cell_height_, cells_y_);
  Moments sum{};
  for (size_t i = 0; i < rows.weights.size(); ++i) {
    const int row = rows.first + static_cast<int>(i);
    Moments row_sum{};
    for (size_t j = 0; j < columns.weights.size(); ++j) {
      const int column = columns.first + static_cast<int>(j);
      const Moments cell = cells_.empty() ? PixelMoments(column, row)
                                          : cells_[static_cast<size_t>(row) * cells_x_ + column];
      for (int m = 0; m < kNumMoments; ++m) row_sum[m] += columns.weights[j] * cell[m];
    }
    for (int m = 0; m < kNumMoments; ++m) sum[m] += rows.weights[i] * row_sum[m];
  }
  return sum;
}

bool WeightedPlanes::Fit(double x, double y, LocalPlane* plane) const {
  const Moments m = WindowMoments(x, y);
  const double sum = m[0];
  if (!(sum > 0)) return false;
  const double mean_x = m[1] / sum, mean_y = m[2] / sum, mean_v = m[6] / sum;
  const double xx = m[3] / sum - mean_x * mean_x;
  const double xy = m[4] / sum - mean_x * mean_y;
  const double yy = m[5] / sum - mean_y * mean_y;
  const double xv = m[7] / sum - mean_x * mean_v;
  const double yv = m[8] / sum - mean_y * mean_v;
  const double determinant = xx * yy - xy * xy;
  // The valid pixels must spread in every direction, by a tenth of a pixel at least.
  if (!(determinant > kMinVariance * (xx + yy))) return false;
  plane->gradient_x = (yy * xv - xy * yv) / determinant;
  plane->gradient_y = (xx * yv - xy * xv) / determinant;
  plane->value = mean_v + plane->gradient_x * (x - 0.5 * map_->width - mean_x) +
                 plane->gradient_y * (y - 0.5 * map_->height - mean_y);
  return true;
}

}  // namespace cairn
