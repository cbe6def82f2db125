#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "cairn/camera/camera.h"
#include "sparse/block_cholesky.h"

namespace cairn {

inline constexpr int kMaxConjugateGradients = 200;  // steps

// The cameras' system of bundle adjustment, the normal equations without the points (Schur
// complement), as a symmetric block matrix over images, and its solution: by factorization where
// that takes no more operations than conjugate gradients may, else by these (Agarwal et al.,
// "Bundle adjustment in the large", 2010). An image's block has its pose (kPose unknowns) and the
// intrinsics of its camera (kIntrinsics), as if it had them for itself; the images of a camera
// share them in products and in the solution. A vector of the unknowns: the poses of all images,
// then the intrinsics of all cameras.
template <int kIntrinsics>
class CameraSystem {
 public:
  static constexpr int kPose = 6;
  static constexpr int kBlock = kPose + kIntrinsics;
  using Block = Eigen::Matrix<double, kBlock, kBlock, Eigen::RowMajor>;
  using IntrinsicsBlock = Eigen::Matrix<double, kIntrinsics, kIntrinsics>;

  // columns[i]: the images from i on that see a point together with image i, ascending, i first; or
  // i alone, where pairs of images are to have no blocks. max_factor_flops: it is not factorized
  // where that takes more operations.
  CameraSystem(const std::vector<std::vector<int>>& columns, std::vector<int> camera_of_image,
               int num_cameras, int num_threads, double max_factor_flops);

  int NumImages() const { return static_cast<int>(camera_of_image_.size()); }
  int NumCameras() const { return num_cameras_; }
  int NumUnknowns() const { return NumImages() * kPose + num_cameras_ * kIntrinsics; }
  Eigen::Index PoseAt(int image) const { return static_cast<Eigen::Index>(image) * kPose; }
  Eigen::Index IntrinsicsAt(int camera) const {
    return static_cast<Eigen::Index>(NumImages()) * kPose + camera * kIntrinsics;
  }
  int CameraOf(int image) const { return camera_of_image_[image]; }

  // The blocks of an image's row, in the order of its columns. The caller fills them.
  int64_t RowBegin(int image) const { return row_begin_[image]; }
  int64_t RowEnd(int image) const { return row_begin_[image + 1]; }
  int Column(int64_t block) const { return column_[block]; }
  Block& BlockAt(int64_t block) { return blocks_[block]; }

  using Images = Eigen::Matrix<double, kBlock, Eigen::Dynamic>;  // a column an image
  // What each image has of a vector of the unknowns (or of a longer one that begins with them).
  Images Spread(const Eigen::VectorXd& x) const;
  // Adds what images have to the unknowns.
  void Gather(const Images& images, Eigen::VectorXd& x) const;

  // Pairs of images have blocks.
  bool IsFormed() const { return column_.size() > camera_of_image_.size(); }
  bool IsFactorized() const { return factor_ != nullptr; }
  // Adds `diagonal`, and factorizes. False if the system is not positive definite.
  bool Factorize(const Eigen::VectorXd& diagonal);
  Eigen::VectorXd SolveByFactor(const Eigen::VectorXd& right) const {
    return factor_->Solve(right);
  }
  // Without a factor, `diagonal` added: by conjugate gradients with a preconditioner of the
  // diagonal blocks, those of the cameras' intrinsics by `intrinsics`. They end when an iteration
  // promises less than a tenth of the mean one before (Nash and Sofer, "Assessing a search
  // direction within a truncated-Newton method", 1990). multiply: the product with the system,
  // without `diagonal`.
  using Product = std::function<Eigen::VectorXd(const Eigen::VectorXd&)>;
  Eigen::VectorXd SolveByProducts(const Product& multiply, std::vector<IntrinsicsBlock> intrinsics,
                                  const Eigen::VectorXd& diagonal,
                                  const Eigen::VectorXd& right) const;
  // The product of a system that is formed. Equal for any number of threads.
  Eigen::VectorXd Multiply(const Eigen::VectorXd& x) const;

 private:
  // Nodes are the images, then the cameras.
  BlockPattern PatternOfNodes() const;
  void FillFactor(const Eigen::VectorXd& diagonal);
  // Inverses of the diagonal blocks, of poses and of intrinsics.
  struct Preconditioner {
    std::vector<Eigen::Matrix<double, kPose, kPose>> poses;
    std::vector<IntrinsicsBlock> intrinsics;
  };
  Preconditioner MakePreconditioner(std::vector<IntrinsicsBlock> intrinsics,
                                    const Eigen::VectorXd& diagonal) const;
  Eigen::VectorXd Precondition(const Preconditioner& inverse, const Eigen::VectorXd& x) const;

  std::vector<int> camera_of_image_;
  int num_cameras_;
  int num_threads_;
  std::vector<int64_t> row_begin_;
  std::vector<int> column_;
  std::vector<Block> blocks_;
  std::vector<int> part_begin_;            // images; rows that are multiplied as one task
  std::unique_ptr<BlockCholesky> factor_;  // null: conjugate gradients
};

extern template class CameraSystem<4>;
extern template class CameraSystem<8>;
extern template class CameraSystem<kMaxCameraParams>;

}  // namespace cairn
