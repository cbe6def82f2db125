#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>

namespace cairn {

// Corresponding normalized image points as a structure of arrays, in blocks of 16 floats: what the
// scoring kernels read. Points beyond size() in the last block are zero and never counted.
// Grows only, so that a verifier can reuse its memory over pairs.
class PointPairs {
 public:
  static constexpr int kBlock = 16;

  PointPairs() = default;

  // Makes room for n pairs; contents are lost. Focal lengths in pixels turn errors into pixels.
  void Reset(int n, double focal1_px, double focal2_px);

  int size() const { return size_; }
  int num_blocks() const { return (size_ + kBlock - 1) / kBlock; }
  float focal1_px() const { return focal1_px_; }
  float focal2_px() const { return focal2_px_; }

  void Set(int i, const Eigen::Vector2d& x1, const Eigen::Vector2d& x2);
  Eigen::Vector2d Point1(int i) const { return {x1()[i], y1()[i]}; }
  Eigen::Vector2d Point2(int i) const { return {x2()[i], y2()[i]}; }

  // 64-byte aligned, num_blocks() * 16 long.
  const float* x1() const { return data_.get(); }
  const float* y1() const { return data_.get() + capacity_; }
  const float* x2() const { return data_.get() + 2 * capacity_; }
  const float* y2() const { return data_.get() + 3 * capacity_; }

  // Drops the pairs from n on.
  void Truncate(int n);

  // The first points of `all` with its second points moved on cyclically by `shift`: pairs of
  // points that have nothing to do with each other.
  void SetShifted(const PointPairs& all, int shift);

  // The first n pairs of `all`.
  void SetPrefix(const PointPairs& all, int n);

  // The pairs picked by indices[0..n), in that order.
  void SetSubset(const PointPairs& all, const int32_t* indices, int n);

 private:
  void ZeroPadding();
  struct Free {
    void operator()(float* pointer) const;
  };
  std::unique_ptr<float[], Free> data_;
  int64_t capacity_ = 0;  // a column's length in floats
  int size_ = 0;
  float focal1_px_ = 1.0f;
  float focal2_px_ = 1.0f;
};

}  // namespace cairn
