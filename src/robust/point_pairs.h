#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>

#include "cairn/camera/camera.h"

namespace cairn {

// Corresponding normalized image points as a structure of arrays, in blocks of 16 floats: what the
// scoring kernels read. Points beyond size() in the last block are zero and never counted. Grows
// only, so that a verifier can reuse its memory over pairs.
//
// Where a camera is not planar, the pairs are "wide": a bearing (x, y, z) is held as the point (x /
// z, y / z) of the plane, be it before or behind the camera, with the sign of z and the weight (s f
// / z)^2, where s is the size of a pixel in radians at the bearing and f the camera's focal length.
// Errors are then those of bearings, in pixels at their own place of the image: on the plane, a
// pixel of an equidistant lens at 70 degrees off axis would count eight times too much.
class PointPairs {
 public:
  static constexpr int kBlock = 16;

  PointPairs() = default;

  // Makes room for n pairs; contents are lost. Focal lengths in pixels turn errors into pixels.
  void Reset(int n, double focal1_px, double focal2_px, bool is_wide = false);
  // The same for pixels of these cameras.
  void Reset(int n, const Camera& camera1, const Camera& camera2);

  bool is_wide() const { return is_wide_; }
  int size() const { return size_; }
  int num_blocks() const { return (size_ + kBlock - 1) / kBlock; }
  float focal1_px() const { return focal1_px_; }
  float focal2_px() const { return focal2_px_; }

  void Set(int i, const Eigen::Vector2d& x1, const Eigen::Vector2d& x2);
  // For wide pairs: rays of any length, and the size of a pixel in radians there.
  void SetRays(int i, const Eigen::Vector3d& ray1, double radians_per_px1,
               const Eigen::Vector3d& ray2, double radians_per_px2);
  // False, and nothing is set, where a camera model has no ray for the pixel.
  bool SetPixels(int i, const Camera& camera1, const Eigen::Vector2d& pixel1, const Camera& camera2,
                 const Eigen::Vector2d& pixel2);
  Eigen::Vector2d Point1(int i) const { return {x1()[i], y1()[i]}; }
  Eigen::Vector2d Point2(int i) const { return {x2()[i], y2()[i]}; }
  // The rays with third component 1, or -1 where a bearing points backward.
  Eigen::Vector3d Ray1(int i) const { return RayOf(Point1(i), IsBehind(weight1(), i)); }
  Eigen::Vector3d Ray2(int i) const { return RayOf(Point2(i), IsBehind(weight2(), i)); }
  bool IsBehind1(int i) const { return IsBehind(weight1(), i); }
  bool IsBehind2(int i) const { return IsBehind(weight2(), i); }

  // 64-byte aligned, num_blocks() * 16 long.
  const float* x1() const { return data_.get(); }
  const float* y1() const { return data_.get() + capacity_; }
  const float* x2() const { return data_.get() + 2 * capacity_; }
  const float* y2() const { return data_.get() + 3 * capacity_; }
  // Of wide pairs: weights, negative where the bearing points backward.
  const float* weight1() const { return data_.get() + 4 * capacity_; }
  const float* weight2() const { return data_.get() + 5 * capacity_; }

  // Drops the pairs from n on.
  void Truncate(int n);

  // The first points of `all` with its second points moved on cyclically by `shift`: pairs of
  // unrelated points.
  void SetShifted(const PointPairs& all, int shift);

  // The first n pairs of `all`.
  void SetPrefix(const PointPairs& all, int n);

  // The pairs picked by indices[0..n), in that order.
  void SetSubset(const PointPairs& all, const int32_t* indices, int n);

 private:
  static Eigen::Vector3d RayOf(const Eigen::Vector2d& x, bool is_behind) {
    return is_behind ? Eigen::Vector3d(-x.x(), -x.y(), -1.0) : Eigen::Vector3d(x.x(), x.y(), 1.0);
  }
  bool IsBehind(const float* weights, int i) const { return is_wide_ && weights[i] < 0.0f; }
  int num_columns() const { return is_wide_ ? 6 : 4; }
  void ZeroPadding();
  struct Free {
    void operator()(float* pointer) const;
  };
  std::unique_ptr<float[], Free> data_;
  int64_t capacity_ = 0;  // a column's length in floats
  int num_columns_held_ = 0;
  int size_ = 0;
  bool is_wide_ = false;
  float focal1_px_ = 1.0f;
  float focal2_px_ = 1.0f;
};

}  // namespace cairn
