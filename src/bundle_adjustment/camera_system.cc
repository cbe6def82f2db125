#include "bundle_adjustment/camera_system.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "cairn/base/parallel.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

constexpr double kMinShareOfGain = 0.1;
// Parts of the product, each with sums of its own: their number must not depend on the threads.
constexpr int kNumParts = 8;

// Of a positive definite block. One function for all sizes: each takes seconds to compile.
Eigen::MatrixXd InverseOf(const Eigen::MatrixXd& block) {
  return block.ldlt().solve(Eigen::MatrixXd::Identity(block.rows(), block.rows()));
}

}  // namespace

template <int kIntrinsics>
CameraSystem<kIntrinsics>::CameraSystem(const std::vector<std::vector<int>>& columns,
                                        std::vector<int> camera_of_image, int num_cameras,
                                        int num_threads, double max_factor_flops)
    : camera_of_image_(std::move(camera_of_image)),
      num_cameras_(num_cameras),
      num_threads_(num_threads),
      row_begin_{0} {
  for (const std::vector<int>& row : columns) {
    column_.insert(column_.end(), row.begin(), row.end());
    row_begin_.push_back(static_cast<int64_t>(column_.size()));
  }
  blocks_.resize(column_.size());
  for (int i = 0, part = 0; i < NumImages(); ++i) {
    for (; part < kNumParts && row_begin_[i] * kNumParts >= part * row_begin_.back(); ++part) {
      part_begin_.push_back(i);
    }
  }
  part_begin_.push_back(NumImages());
  if (!IsFormed()) return;
  BlockPattern pattern = PatternOfNodes();
  if (EstimateFactorFlops(pattern) <= max_factor_flops) {
    factor_ = std::make_unique<BlockCholesky>(std::move(pattern));
  }
}

template <int kIntrinsics>
BlockPattern CameraSystem<kIntrinsics>::PatternOfNodes() const {
  BlockPattern pattern;
  pattern.sizes.assign(NumImages(), kPose);
  pattern.sizes.resize(NumImages() + num_cameras_, kIntrinsics);
  pattern.columns.resize(pattern.sizes.size());
  for (int node = 0; node < static_cast<int>(pattern.sizes.size()); ++node) {
    pattern.columns[node].push_back(node);
  }
  for (int i = 0; i < NumImages(); ++i) {
    for (int64_t k = RowBegin(i); k < RowEnd(i); ++k) {
      const int camera1 = NumImages() + camera_of_image_[i];
      const int camera2 = NumImages() + camera_of_image_[column_[k]];
      pattern.columns[i].push_back(column_[k]);
      pattern.columns[i].push_back(camera2);
      pattern.columns[column_[k]].push_back(camera1);
      pattern.columns[std::min(camera1, camera2)].push_back(std::max(camera1, camera2));
    }
  }
  for (std::vector<int>& column : pattern.columns) column = Unique(std::move(column));
  return pattern;
}

template <int kIntrinsics>
void CameraSystem<kIntrinsics>::FillFactor(const Eigen::VectorXd& diagonal) {
  factor_->SetZero();
  factor_->AddToDiagonal(diagonal);
  for (int i = 0; i < NumImages(); ++i) {
    for (int64_t k = RowBegin(i); k < RowEnd(i); ++k) {
      const Block& block = blocks_[k];
      const int j = column_[k];
      const int camera1 = NumImages() + camera_of_image_[i];
      const int camera2 = NumImages() + camera_of_image_[j];
      const auto shared = block.template bottomRightCorner<kIntrinsics, kIntrinsics>();
      factor_->Add(j, i, block.template topLeftCorner<kPose, kPose>().transpose());
      factor_->Add(camera2, i, block.template topRightCorner<kPose, kIntrinsics>().transpose());
      if (i != j) factor_->Add(camera1, j, block.template bottomLeftCorner<kIntrinsics, kPose>());
      if (camera1 >= camera2) factor_->Add(camera1, camera2, shared);
      if (camera1 <= camera2 && i != j) factor_->Add(camera2, camera1, shared.transpose());
    }
  }
}

template <int kIntrinsics>
auto CameraSystem<kIntrinsics>::Spread(const Eigen::VectorXd& x) const -> Images {
  Images images(kBlock, NumImages());
  for (int i = 0; i < NumImages(); ++i) {
    images.col(i) << x.segment<kPose>(PoseAt(i)),
        x.segment<kIntrinsics>(IntrinsicsAt(camera_of_image_[i]));
  }
  return images;
}

template <int kIntrinsics>
void CameraSystem<kIntrinsics>::Gather(const Images& images, Eigen::VectorXd& x) const {
  for (int i = 0; i < NumImages(); ++i) {
    x.segment<kPose>(PoseAt(i)) += images.col(i).template head<kPose>();
    x.segment<kIntrinsics>(IntrinsicsAt(camera_of_image_[i])) +=
        images.col(i).template tail<kIntrinsics>();
  }
}

template <int kIntrinsics>
Eigen::VectorXd CameraSystem<kIntrinsics>::Multiply(const Eigen::VectorXd& x) const {
  const Images X = Spread(x);
  std::vector<Images> sums(part_begin_.size() - 1);
  ParallelFor(num_threads_, static_cast<int64_t>(sums.size()), [&](int64_t part) {
    Images& Y = sums[part];
    Y.setZero(kBlock, NumImages());
    for (int i = part_begin_[part]; i < part_begin_[part + 1]; ++i) {
      Eigen::Matrix<double, kBlock, 1> y = blocks_[RowBegin(i)].lazyProduct(X.col(i));
      for (int64_t k = RowBegin(i) + 1; k < RowEnd(i); ++k) {
        y += blocks_[k].lazyProduct(X.col(column_[k]));
        Y.col(column_[k]) += blocks_[k].transpose().lazyProduct(X.col(i));
      }
      Y.col(i) += y;
    }
  });
  Eigen::VectorXd result = Eigen::VectorXd::Zero(x.size());
  for (const Images& Y : sums) Gather(Y, result);
  return result;
}

template <int kIntrinsics>
auto CameraSystem<kIntrinsics>::MakePreconditioner(std::vector<IntrinsicsBlock> intrinsics,
                                                   const Eigen::VectorXd& diagonal) const
    -> Preconditioner {
  using PoseBlock = Eigen::Matrix<double, kPose, kPose>;
  Preconditioner inverse{{}, std::move(intrinsics)};
  for (int i = 0; i < NumImages(); ++i) {
    PoseBlock pose = blocks_[RowBegin(i)].template topLeftCorner<kPose, kPose>();
    pose.diagonal() += diagonal.segment<kPose>(PoseAt(i));
    inverse.poses.push_back(InverseOf(pose));
  }
  for (int c = 0; c < num_cameras_; ++c) {
    inverse.intrinsics[c].diagonal() += diagonal.segment<kIntrinsics>(IntrinsicsAt(c));
    inverse.intrinsics[c] = InverseOf(inverse.intrinsics[c]);
  }
  return inverse;
}

template <int kIntrinsics>
Eigen::VectorXd CameraSystem<kIntrinsics>::Precondition(const Preconditioner& inverse,
                                                        const Eigen::VectorXd& x) const {
  Eigen::VectorXd result(x.size());
  for (int i = 0; i < NumImages(); ++i) {
    result.segment<kPose>(PoseAt(i)) = inverse.poses[i] * x.segment<kPose>(PoseAt(i));
  }
  for (int c = 0; c < num_cameras_; ++c) {
    result.segment<kIntrinsics>(IntrinsicsAt(c)) =
        inverse.intrinsics[c] * x.segment<kIntrinsics>(IntrinsicsAt(c));
  }
  return result;
}

template <int kIntrinsics>
bool CameraSystem<kIntrinsics>::Factorize(const Eigen::VectorXd& diagonal) {
  FillFactor(diagonal);
  return factor_->Factorize();
}

template <int kIntrinsics>
Eigen::VectorXd CameraSystem<kIntrinsics>::SolveByProducts(const Product& multiply,
                                                           std::vector<IntrinsicsBlock> intrinsics,
                                                           const Eigen::VectorXd& diagonal,
                                                           const Eigen::VectorXd& right) const {
  const Preconditioner inverse = MakePreconditioner(std::move(intrinsics), diagonal);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(right.size());
  Eigen::VectorXd residual = right;
  Eigen::VectorXd direction = Precondition(inverse, residual);
  double rho = residual.dot(direction);
  double gain = 0;  // twice what the quadratic model has fallen
  for (int k = 1; k <= kMaxConjugateGradients && rho > 0; ++k) {
    const Eigen::VectorXd image = diagonal.cwiseProduct(direction) + multiply(direction);
    const double curvature = direction.dot(image);
    if (!(curvature > 0)) break;
    const double length = rho / curvature;
    x += length * direction;
    residual -= length * image;
    gain += length * rho;
    if (k * length * rho < kMinShareOfGain * gain) break;
    const Eigen::VectorXd z = Precondition(inverse, residual);
    const double next_rho = residual.dot(z);
    direction = z + (next_rho / rho) * direction;
    rho = next_rho;
  }
  return x;
}

template class CameraSystem<4>;
template class CameraSystem<8>;
template class CameraSystem<kMaxCameraParams>;

}  // namespace cairn
