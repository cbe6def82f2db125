#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "bundle_adjustment/bundle_observations.h"
#include "bundle_adjustment/camera_system.h"
#include "bundle_adjustment/linear_bundle.h"
#include "cairn/base/parallel.h"

namespace cairn {

// What conjugate gradients ask of the cameras' system (camera_system.h), by way of the points, in
// time and memory of the observations, however many pairs of images see a point together (Agarwal
// et al., "Bundle adjustment in the large", 2010, section 3.2). Equal for any number of threads.
template <int kIntrinsics>
class SchurProduct {
 public:
  using Bundle = LinearBundle<kIntrinsics>;
  using System = CameraSystem<kIntrinsics>;
  using IntrinsicsBlock = typename System::IntrinsicsBlock;

  // inverse: of the points' blocks.
  SchurProduct(const BundleObservations& observations, const System& system, const Bundle& linear,
               const std::vector<Eigen::Matrix3d>& inverse, int num_threads)
      : observations_(observations),
        system_(system),
        linear_(linear),
        inverse_(inverse),
        num_threads_(num_threads) {}

  // The product with a vector of the unknowns: what it moves in the pictures where the points
  // follow, back in the unknowns.
  Eigen::VectorXd Multiply(const Eigen::VectorXd& x) const {
    const Images X = system_.Spread(x);
    std::vector<Images> sums(kNumParts);
    ForEachPart(kNumParts, [&](int64_t part, int64_t begin, int64_t end) {
      Images& Y = sums[part];
      Y.setZero(System::kBlock, system_.NumImages());
      std::vector<Eigen::Vector2d> moved;
      for (int64_t p = begin; p < end; ++p) AddPoint(p, X, moved, Y);
    });
    Eigen::VectorXd result = Eigen::VectorXd::Zero(x.size());
    for (const Images& Y : sums) system_.Gather(Y, result);
    return result;
  }

  // The diagonal blocks of the cameras' intrinsics.
  std::vector<IntrinsicsBlock> IntrinsicsBlocks() const {
    const std::vector<IntrinsicsBlock> zero(system_.NumCameras(), IntrinsicsBlock::Zero());
    std::vector<std::vector<IntrinsicsBlock>> sums(kNumBlockParts, zero);
    ForEachPart(kNumBlockParts, [&](int64_t part, int64_t begin, int64_t end) {
      std::vector<Slopes> slopes(system_.NumCameras(), Slopes::Zero());
      for (int64_t p = begin; p < end; ++p) AddPoint(p, slopes, sums[part]);
    });
    for (int part = 1; part < kNumBlockParts; ++part) {
      for (int c = 0; c < system_.NumCameras(); ++c) sums[0][c] += sums[part][c];
    }
    return std::move(sums[0]);
  }

 private:
  using Images = typename System::Images;
  using Slopes = Eigen::Matrix<double, 3, kIntrinsics>;  // a point's gradients by intrinsics

  // Parts of the points, each with sums of its own: their number must not depend on the threads. A
  // block of each camera takes more than a vector of each image.
  static constexpr int kNumParts = 32, kNumBlockParts = 8;

  template <typename Fn>
  void ForEachPart(int num_parts, const Fn& fn) const {
    const int64_t num = observations_.NumPoints();
    ParallelFor(num_threads_, num_parts, [&](int64_t part) {
      fn(part, num * part / num_parts, num * (part + 1) / num_parts);
    });
  }

  // moved: scratch.
  void AddPoint(int64_t p, const Images& X, std::vector<Eigen::Vector2d>& moved, Images& Y) const {
    const int begin = observations_.begin[p], end = observations_.begin[p + 1];
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    moved.clear();
    for (int k = begin; k < end; ++k) {
      moved.emplace_back(linear_[k].by_camera.template cast<double>() *
                         X.col(observations_.all[k].image));
      right += linear_[k].by_point.template cast<double>().transpose() * moved.back();
    }
    const Eigen::Vector3d point = inverse_[p] * right;
    for (int k = begin; k < end; ++k) {
      Y.col(observations_.all[k].image) +=
          linear_[k].by_camera.template cast<double>().transpose() *
          (moved[k - begin] - linear_[k].by_point.template cast<double>() * point);
    }
  }

  // slopes: scratch, zero before and after.
  void AddPoint(int64_t p, std::vector<Slopes>& slopes, std::vector<IntrinsicsBlock>& sum) const {
    const int begin = observations_.begin[p], end = observations_.begin[p + 1];
    for (int k = begin; k < end; ++k) {
      const int camera = system_.CameraOf(observations_.all[k].image);
      const Eigen::Matrix<double, 2, kIntrinsics> J =
          linear_[k].by_camera.template rightCols<kIntrinsics>().template cast<double>();
      slopes[camera] += linear_[k].by_point.template cast<double>().transpose() * J;
      sum[camera] += J.transpose() * J;
    }
    for (int k = begin; k < end; ++k) {
      Slopes& slope = slopes[system_.CameraOf(observations_.all[k].image)];
      if (slope.isZero(0)) continue;
      sum[system_.CameraOf(observations_.all[k].image)] -= slope.transpose() * inverse_[p] * slope;
      slope.setZero();
    }
  }

  const BundleObservations& observations_;
  const System& system_;
  const Bundle& linear_;
  const std::vector<Eigen::Matrix3d>& inverse_;
  const int num_threads_;
};

}  // namespace cairn
