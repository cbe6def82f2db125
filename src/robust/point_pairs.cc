#include "cairn/robust/point_pairs.h"

#include <algorithm>
#include <cstddef>
#include <new>

#include "cairn/base/check.h"

namespace cairn {

void PointPairs::Free::operator()(float* pointer) const {
  ::operator delete[](pointer, std::align_val_t{64});
}

void PointPairs::Reset(int n, double focal1_px, double focal2_px) {
  CAIRN_CHECK_GE(n, 0);
  CAIRN_CHECK(focal1_px > 0 && focal2_px > 0);
  const int64_t column = (static_cast<int64_t>(n) + kBlock - 1) / kBlock * kBlock;
  if (column > capacity_) {
    capacity_ = std::max(column, 2 * capacity_);
    data_.reset(
        static_cast<float*>(::operator new[](4 * capacity_ * sizeof(float), std::align_val_t{64})));
  }
  size_ = n;
  focal1_px_ = static_cast<float>(focal1_px);
  focal2_px_ = static_cast<float>(focal2_px);
  ZeroPadding();
}

void PointPairs::ZeroPadding() {
  for (int k = 0; k < 4; ++k) {
    float* begin = data_.get() + k * capacity_;
    std::fill(begin + size_, begin + num_blocks() * kBlock, 0.0f);
  }
}

void PointPairs::Truncate(int n) {
  CAIRN_CHECK(n >= 0 && n <= size_);
  size_ = n;
  ZeroPadding();
}

void PointPairs::SetShifted(const PointPairs& all, int shift) {
  CAIRN_CHECK(shift >= 0 && shift <= all.size_);
  Reset(all.size_, all.focal1_px_, all.focal2_px_);
  for (int k = 0; k < 4; ++k) {
    const float* from = all.data_.get() + k * all.capacity_;
    float* to = data_.get() + k * capacity_;
    std::rotate_copy(from, from + (k < 2 ? 0 : shift), from + size_, to);
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

void PointPairs::SetPrefix(const PointPairs& all, int n) {
  CAIRN_CHECK(n >= 0 && n <= all.size_);
  Reset(n, all.focal1_px_, all.focal2_px_);
  for (int k = 0; k < 4; ++k) {
    const float* from = all.data_.get() + k * all.capacity_;
    std::copy(from, from + n, data_.get() + k * capacity_);
  }
}

void PointPairs::SetSubset(const PointPairs& all, const int32_t* indices, int n) {
  Reset(n, all.focal1_px_, all.focal2_px_);
  for (int k = 0; k < 4; ++k) {
    const float* from = all.data_.get() + k * all.capacity_;
    float* to = data_.get() + k * capacity_;
    for (int i = 0; i < n; ++i) to[i] = from[indices[i]];
  }
}

}  // namespace cairn
