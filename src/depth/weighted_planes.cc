#include "depth/weighted_planes.h"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr double kMinSigma = 0.5;       // map pixels; below it a window may hold no second pixel
constexpr double kCellsPerSigma = 4.0;  // resolution at which the moments are blurred
constexpr double kTruncation = 3.0;     // standard deviations

std::vector<double> GaussianKernel(double sigma) {
  const int radius = std::max(1, static_cast<int>(std::ceil(kTruncation * sigma)));
  std::vector<double> kernel(2 * radius + 1);
  for (int i = -radius; i <= radius; ++i) {
    kernel[i + radius] = std::exp(-0.5 * i * i / (sigma * sigma));
  }
  return kernel;
}

// Convolves `count` items, `stride` apart.
template <class Moments>
void BlurLine(const std::vector<double>& kernel, int count, int stride, const Moments* source,
              Moments* target) {
  const int radius = static_cast<int>(kernel.size()) / 2;
  for (int i = 0; i < count; ++i) {
    Moments sum{};
    for (int k = std::max(0, i - radius); k <= std::min(count - 1, i + radius); ++k) {
      const double weight = kernel[k - i + radius];
      const Moments& moments = source[static_cast<size_t>(k) * stride];
      for (size_t m = 0; m < sum.size(); ++m) sum[m] += weight * moments[m];
    }
    target[static_cast<size_t>(i) * stride] = sum;
  }
}

}  // namespace

WeightedPlanes::WeightedPlanes(const DepthMap& map, const std::vector<double>& values,
                               double sigma_x, double sigma_y) {
  sigma_x = std::max(sigma_x, kMinSigma);
  sigma_y = std::max(sigma_y, kMinSigma);
  cell_width_ = std::max(1, static_cast<int>(sigma_x / kCellsPerSigma));
  cell_height_ = std::max(1, static_cast<int>(sigma_y / kCellsPerSigma));
  cells_x_ = (map.width + cell_width_ - 1) / cell_width_;
  cells_y_ = (map.height + cell_height_ - 1) / cell_height_;
  center_x_ = 0.5 * map.width;
  center_y_ = 0.5 * map.height;

  moments_.assign(static_cast<size_t>(cells_x_) * cells_y_, Moments{});
  for (int row = 0; row < map.height; ++row) {
    const double y = row + 0.5 - center_y_;
    for (int column = 0; column < map.width; ++column) {
      const size_t pixel = static_cast<size_t>(row) * map.width + column;
      if (!map.is_valid[pixel]) continue;
      const double x = column + 0.5 - center_x_;
      const double v = values[pixel];
      Moments& m =
          moments_[static_cast<size_t>(row / cell_height_) * cells_x_ + column / cell_width_];
      const Moments added = {1, x, y, x * x, x * y, y * y, v, v * x, v * y};
      for (int i = 0; i < kNumMoments; ++i) m[i] += added[i];
    }
  }

  std::vector<Moments> blurred(moments_.size());
  const std::vector<double> kernel_x = GaussianKernel(sigma_x / cell_width_);
  for (int row = 0; row < cells_y_; ++row) {
    const size_t begin = static_cast<size_t>(row) * cells_x_;
    BlurLine(kernel_x, cells_x_, 1, &moments_[begin], &blurred[begin]);
  }
  const std::vector<double> kernel_y = GaussianKernel(sigma_y / cell_height_);
  for (int column = 0; column < cells_x_; ++column) {
    BlurLine(kernel_y, cells_y_, cells_x_, &blurred[column], &moments_[column]);
  }
}

bool WeightedPlanes::Fit(double x, double y, LocalPlane* plane) const {
  // A blend of the moments of the four cells around is again a weighted sum over the map.
  const double cell_x = std::clamp(x / cell_width_ - 0.5, 0.0, cells_x_ - 1.0);
  const double cell_y = std::clamp(y / cell_height_ - 0.5, 0.0, cells_y_ - 1.0);
  const int x0 = static_cast<int>(cell_x), y0 = static_cast<int>(cell_y);
  const int x1 = std::min(x0 + 1, cells_x_ - 1), y1 = std::min(y0 + 1, cells_y_ - 1);
  const double fx = cell_x - x0, fy = cell_y - y0;
  Moments m{};
  const auto add = [&](int column, int row, double weight) {
    const Moments& cell = moments_[static_cast<size_t>(row) * cells_x_ + column];
    for (int i = 0; i < kNumMoments; ++i) m[i] += weight * cell[i];
  };
  add(x0, y0, (1 - fx) * (1 - fy));
  add(x1, y0, fx * (1 - fy));
  add(x0, y1, (1 - fx) * fy);
  add(x1, y1, fx * fy);

  const double sum = m[0];
  if (!(sum > 0)) return false;
  const double mean_x = m[1] / sum, mean_y = m[2] / sum, mean_v = m[6] / sum;
  const double xx = m[3] / sum - mean_x * mean_x;
  const double xy = m[4] / sum - mean_x * mean_y;
  const double yy = m[5] / sum - mean_y * mean_y;
  const double xv = m[7] / sum - mean_x * mean_v;
  const double yv = m[8] / sum - mean_y * mean_v;
  const double determinant = xx * yy - xy * xy;
  // The valid pixels have to spread over the plane: a fraction of a pixel in every direction.
  if (!(determinant > 1e-3 * (xx + yy)) || !(xx + yy > 0.05)) return false;
  plane->gradient_x = (yy * xv - xy * yv) / determinant;
  plane->gradient_y = (xx * yv - xy * xv) / determinant;
  plane->value = mean_v + plane->gradient_x * (x - center_x_ - mean_x) +
                 plane->gradient_y * (y - center_y_ - mean_y);
  return true;
}

}  // namespace cairn
