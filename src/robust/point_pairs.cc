#include "robust/point_pairs.h"

#include <algorithm>
#include <cmath>
#include <new>

#include "cairn/base/check.h"

namespace cairn {

void PointPairs::Free::operator()(float* pointer) const {
  ::operator delete[](pointer, std::align_val_t{64});
}

void PointPairs::Reset(int n, double focal1_px, double focal2_px, bool is_wide) {
  CAIRN_CHECK_GE(n, 0);
  CAIRN_CHECK(focal1_px > 0 && focal2_px > 0);
  is_wide_ = is_wide;
  const int64_t column = (static_cast<int64_t>(n) + kBlock - 1) / kBlock * kBlock;
  if (column > capacity_ || num_columns() > num_columns_held_) {
    if (column > capacity_) capacity_ = std::max(column, 2 * capacity_);
    num_columns_held_ = std::max(num_columns(), num_columns_held_);
    data_.reset(static_cast<float*>(
        ::operator new[](num_columns_held_* capacity_ * sizeof(float), std::align_val_t{64})));
  }
  size_ = n;
  focal1_px_ = static_cast<float>(focal1_px);
  focal2_px_ = static_cast<float>(focal2_px);
  ZeroPadding();
}

void PointPairs::Reset(int n, const Camera& camera1, const Camera& camera2) {
  Reset(n, camera1.MeanFocal(), camera2.MeanFocal(), !camera1.IsPlanar() || !camera2.IsPlanar());
}

void PointPairs::ZeroPadding() {
  for (int k = 0; k < num_columns(); ++k) {
    float* begin = data_.get() + k * capacity_;
    // (Weights must not be zero: they are divided by.)
    std::fill(begin + size_, begin + num_blocks() * kBlock, k < 4 ? 0.0f : 1.0f);
  }
}

void PointPairs::Truncate(int n) {
  CAIRN_CHECK(n >= 0 && n <= size_);
  size_ = n;
  ZeroPadding();
}

void PointPairs::SetShifted(const PointPairs& all, int shift) {
  CAIRN_CHECK(shift >= 0 && shift <= all.size_);
  Reset(all.size_, all.focal1_px_, all.focal2_px_, all.is_wide_);
  for (int k = 0; k < num_columns(); ++k) {
    const float* from = all.data_.get() + k * all.capacity_;
    float* to = data_.get() + k * capacity_;
    const bool is_of_image1 = k < 2 || k == 4;
    std::rotate_copy(from, from + (is_of_image1 ? 0 : shift), from + size_, to);
  }
}

void PointPairs::Set(int i, const Eigen::Vector2d& x1, const Eigen::Vector2d& x2) {
  CAIRN_DCHECK(i >= 0 && i < size_);
  float* p = data_.get() + i;
  p[0] = static_cast<float>(x1.x());
  p[capacity_] = static_cast<float>(x1.y());
  p[2 * capacity_] = static_cast<float>(x2.x());
  p[3 * capacity_] = static_cast<float>(x2.y());
}

void PointPairs::SetRays(int i, const Eigen::Vector3d& ray1, double radians_per_px1,
                         const Eigen::Vector3d& ray2, double radians_per_px2) {
  CAIRN_DCHECK(is_wide_);
  const auto hold = [&](const Eigen::Vector3d& ray, double radians_per_px, float focal, int point,
                        int weight) {
    // Bearings within 0.006 degrees of the plane through the center are moved off it.
    constexpr double kMinZ = 1e-4;
    const Eigen::Vector3d unit = ray.normalized();
    const double z = std::copysign(std::max(std::abs(unit.z()), kMinZ), unit.z());
    const double scale = radians_per_px * focal / z;
    float* p = data_.get() + i;
    p[point * capacity_] = static_cast<float>(unit.x() / z);
    p[(point + 1) * capacity_] = static_cast<float>(unit.y() / z);
    p[weight * capacity_] = static_cast<float>(std::copysign(scale * scale, z));
  };
  hold(ray1, radians_per_px1, focal1_px_, 0, 4);
  hold(ray2, radians_per_px2, focal2_px_, 2, 5);
}

bool PointPairs::SetPixels(int i, const Camera& camera1, const Eigen::Vector2d& pixel1,
                           const Camera& camera2, const Eigen::Vector2d& pixel2) {
  if (!is_wide_) {
    const auto x1 = camera1.CamFromImg(pixel1);
    const auto x2 = camera2.CamFromImg(pixel2);
    if (!x1 || !x2) return false;
    Set(i, *x1, *x2);
    return true;
  }
  const auto ray1 = camera1.RayFromImg(pixel1);
  const auto ray2 = camera2.RayFromImg(pixel2);
  if (!ray1 || !ray2) return false;
  // (Focal lengths that are not the cameras' own count errors in units that are not their pixels.)
  const double radians_per_px1 =
      camera1.RadiansPerPx(*ray1) * (static_cast<float>(camera1.MeanFocal()) / focal1_px_);
  const double radians_per_px2 =
      camera2.RadiansPerPx(*ray2) * (static_cast<float>(camera2.MeanFocal()) / focal2_px_);
  if (!std::isfinite(radians_per_px1) || !std::isfinite(radians_per_px2)) return false;
  SetRays(i, *ray1, radians_per_px1, *ray2, radians_per_px2);
  return true;
}

void PointPairs::SetPrefix(const PointPairs& all, int n) {
  CAIRN_CHECK(n >= 0 && n <= all.size_);
  Reset(n, all.focal1_px_, all.focal2_px_, all.is_wide_);
  for (int k = 0; k < num_columns(); ++k) {
    const float* from = all.data_.get() + k * all.capacity_;
    std::copy(from, from + n, data_.get() + k * capacity_);
  }
}

void PointPairs::SetSubset(const PointPairs& all, const int32_t* indices, int n) {
  Reset(n, all.focal1_px_, all.focal2_px_, all.is_wide_);
  for (int k = 0; k < num_columns(); ++k) {
    const float* from = all.data_.get() + k * all.capacity_;
    float* to = data_.get() + k * capacity_;
    for (int i = 0; i < n; ++i) to[i] = from[indices[i]];
  }
}

}  // namespace cairn
