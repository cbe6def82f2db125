#include "cairn/solvers/one_affine_depth_batch.h"

#include <algorithm>
#include <cstddef>
#include <new>

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solvers/one_affine_depth_batch.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd16-inl.h"

#ifndef CAIRN_SOLVERS_BATCH_COLUMNS_
#define CAIRN_SOLVERS_BATCH_COLUMNS_
namespace cairn::internal {
// Inputs: point (3), first axis (3), second axis (3) of view 1, then of view 2.
// Outputs: R (9, row-major), t (3), and 1 where the sample is good.
inline constexpr int kNumInputs = 18, kNumOutputs = 13, kNumColumns = kNumInputs + kNumOutputs;
}  // namespace cairn::internal
#endif

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

struct V3 {
  V x, y, z;
};
HWY_INLINE V3 LoadV3(const float* p, int stride) {
  return {Load(p), Load(p + stride), Load(p + 2 * stride)};
}
HWY_INLINE V Dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
HWY_INLINE V3 Cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
HWY_INLINE V3 Scale(const V3& a, V s) { return {a.x * s, a.y * s, a.z * s}; }

// Rows of a rotation: Dot gives a component of a rotated vector.
struct Rotation {
  V3 rows[3];
  V3 Apply(const V3& v) const { return {Dot(rows[0], v), Dot(rows[1], v), Dot(rows[2], v)}; }
};

// One view: its orthonormal frame that keeps the second axis, and what decides if it is usable.
struct View {
  V3 point, first, second;
  V3 normal, middle, axis;  // columns of the frame
  V side;                   // which side of the surface is seen
  hn::Mask<Tag> is_good;
};

HWY_INLINE View LoadView(const float* columns, int stride) {
  View view;
  view.point = LoadV3(columns, stride);
  view.first = LoadV3(columns + 3 * stride, stride);
  view.second = LoadV3(columns + 6 * stride, stride);
  const V zero = Const(0.0f), one = Const(1.0f);
  const V3 cross = Cross(view.first, view.second);
  const V squared_cross = Dot(cross, cross), squared_second = Dot(view.second, view.second);
  // As in OneAffineDepthProposed, with the precision of float.
  const V limit = Const(1e-8f) * Dot(view.first, view.first) * squared_second;
  view.is_good = hn::And(squared_cross > limit, view.point.z > zero);
  view.normal = Scale(cross, one / hn::Sqrt(hn::IfThenElse(view.is_good, squared_cross, one)));
  view.axis = Scale(view.second, one / hn::Sqrt(hn::IfThenElse(view.is_good, squared_second, one)));
  view.middle = Cross(view.axis, view.normal);
  view.side = Dot(view.point, view.normal);
  return view;
}

void SolveKernel(float* columns, int stride, int n) {
  float* out = columns + static_cast<ptrdiff_t>(internal::kNumInputs) * stride;
  const V zero = Const(0.0f), one = Const(1.0f);
  for (int i = 0; i < n; i += kLanes) {
    const View v1 = LoadView(columns + i, stride);
    const View v2 = LoadView(columns + 9 * static_cast<ptrdiff_t>(stride) + i, stride);
    // R = frame2 frame1^T.
    auto row = [&](V normal2, V middle2, V axis2) {
      return V3{normal2 * v1.normal.x + middle2 * v1.middle.x + axis2 * v1.axis.x,
                normal2 * v1.normal.y + middle2 * v1.middle.y + axis2 * v1.axis.y,
                normal2 * v1.normal.z + middle2 * v1.middle.z + axis2 * v1.axis.z};
    };
    const Rotation R = {{row(v2.normal.x, v2.middle.x, v2.axis.x),
                         row(v2.normal.y, v2.middle.y, v2.axis.y),
                         row(v2.normal.z, v2.middle.z, v2.axis.z)}};
    const V covariance = Dot(R.Apply(v1.first), v2.first) + Dot(R.Apply(v1.second), v2.second);
    const V variance = Dot(v1.first, v1.first) + Dot(v1.second, v1.second);
    auto is_good = hn::And(hn::And(v1.is_good, v2.is_good),
                           hn::And(v1.side * v2.side > zero, covariance > zero));
    const V scale = covariance / hn::IfThenElse(is_good, variance, one);
    const V3 rotated = R.Apply(v1.point);
    const V3 t = {v2.point.x - scale * rotated.x, v2.point.y - scale * rotated.y,
                  v2.point.z - scale * rotated.z};
    const V squared_t = Dot(t, t);
    is_good = hn::And(is_good, hn::And(squared_t > Const(1e-12f) * Dot(v2.point, v2.point),
                                       squared_t < Const(1e38f)));
    const V3 unit_t = Scale(t, one / hn::Sqrt(hn::IfThenElse(is_good, squared_t, one)));
    const V values[internal::kNumOutputs] = {R.rows[0].x,
                                             R.rows[0].y,
                                             R.rows[0].z,
                                             R.rows[1].x,
                                             R.rows[1].y,
                                             R.rows[1].z,
                                             R.rows[2].x,
                                             R.rows[2].y,
                                             R.rows[2].z,
                                             unit_t.x,
                                             unit_t.y,
                                             unit_t.z,
                                             hn::IfThenElse(is_good, one, zero)};
    for (int k = 0; k < internal::kNumOutputs; ++k) {
      hn::Store(values[k], kTag, out + static_cast<ptrdiff_t>(k) * stride + i);
    }
  }
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {

HWY_EXPORT(SolveKernel);

void OneAffineDepthBatch::Free::operator()(float* pointer) const {
  ::operator delete[](pointer, std::align_val_t{64});
}

void OneAffineDepthBatch::Reset(int n) {
  stride_ = (n + 15) / 16 * 16;
  if (stride_ > capacity_) {
    capacity_ = std::max(stride_, 2 * capacity_);
    data_.reset(static_cast<float*>(
        ::operator new[](sizeof(float) * internal::kNumColumns * capacity_, std::align_val_t{64})));
  }
  size_ = n;
  // Lanes beyond n: zero frames, which are rejected.
  for (int k = 0; k < internal::kNumInputs; ++k) {
    float* column = data_.get() + static_cast<ptrdiff_t>(k) * stride_;
    std::fill(column + n, column + stride_, 0.0f);
  }
}

void OneAffineDepthBatch::Set(int i, const LiftedFrame& frame1, const LiftedFrame& frame2) {
  float* p = data_.get() + i;
  for (const LiftedFrame* frame : {&frame1, &frame2}) {
    for (int k = 0; k < 3; ++k) {
      p[static_cast<ptrdiff_t>(k) * stride_] = static_cast<float>(frame->point[k]);
    }
    for (int k = 0; k < 6; ++k) {
      p[static_cast<ptrdiff_t>(3 + k) * stride_] =
          static_cast<float>(frame->derivative(k % 3, k / 3));
    }
    p += 9 * static_cast<ptrdiff_t>(stride_);
  }
}

void OneAffineDepthBatch::Solve() {
  HWY_DYNAMIC_DISPATCH(SolveKernel)(data_.get(), stride_, size_);
}

bool OneAffineDepthBatch::Get(int i, Eigen::Matrix3d* R, Eigen::Vector3d* t) const {
  const float* p = data_.get() + static_cast<ptrdiff_t>(internal::kNumInputs) * stride_ + i;
  auto value = [&](int k) { return static_cast<double>(p[static_cast<ptrdiff_t>(k) * stride_]); };
  if (value(12) == 0.0) return false;
  for (int k = 0; k < 9; ++k) (*R)(k / 3, k % 3) = value(k);
  for (int k = 0; k < 3; ++k) (*t)[k] = value(9 + k);
  return true;
}

}  // namespace cairn
#endif
