#pragma once

#include <Eigen/Core>
#include <memory>

#include "cairn/solvers/one_affine_depth.h"

namespace cairn {

// 1AC+D (Proposed) for many correspondences at once, in float, sixteen side by side: see
// OneAffineDepthProposed. Memory grows only, so that an object serves many pairs.
class OneAffineDepthBatch {
 public:
  void Reset(int n);  // contents are lost
  int size() const { return size_; }
  void Set(int i, const LiftedFrame& frame1, const LiftedFrame& frame2);

  void Solve();

  // After Solve: false where the sample was rejected. t is normalized.
  bool Get(int i, Eigen::Matrix3d* R, Eigen::Vector3d* t) const;

 private:
  struct Free {
    void operator()(float* pointer) const;
  };
  std::unique_ptr<float[], Free> data_;  // columns
  int size_ = 0;
  int stride_ = 0;
  int capacity_ = 0;
};

}  // namespace cairn
