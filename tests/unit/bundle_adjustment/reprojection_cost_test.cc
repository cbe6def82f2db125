#include "bundle_adjustment/reprojection_cost.h"

#include "cairn/math/so3.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"

namespace cairn {
namespace {

// Moves every parameter block of the first observation by `delta` and evaluates.
class CostUnderTest {
 public:
  CostUnderTest(CameraModel model, const BundleAdjustmentScope& scope)
      : truth_(MakeSyntheticScene({.num_points = 5, .noise_px = 3, .model = model}).truth),
        state_(scope, truth_),
        free_{scope.points, scope.rotations, scope.positions} {
    PoseState& pose = state_.Pose(2);
    if (free_.point) blocks_.push_back(state_.Point(0).data());
    if (free_.rotation || free_.position) {
      blocks_.push_back(pose.block.data() + (free_.rotation ? 0 : 3));
    }
    if (pose.intrinsics->num_free > 0) blocks_.push_back(pose.intrinsics->free.data());
    if (free_.rotation) pose.block[0] = 0.3, pose.block[1] = -0.5, pose.block[2] = 0.2;
    for (int i = 0; i < pose.intrinsics->num_free_focal; ++i)
      pose.intrinsics->free[i] = 0.1 + 0.2 * i;
    state_.PrepareForEvaluation(true, true);
    cost_ = std::make_unique<ReprojectionCost>(
        Reprojection{&pose, &state_.Point(0), {300, 500}, 2.5, free_});
  }

  const std::vector<int32_t>& sizes() const { return cost_->parameter_block_sizes(); }

  Eigen::Vector2d Residual(size_t block, int i, double delta) {
    const double old = blocks_[block][i];
    blocks_[block][i] += delta;
    Eigen::Vector2d residual;
    state_.PrepareForEvaluation(false, true);
    EXPECT_TRUE(cost_->Evaluate(blocks_.data(), residual.data(), nullptr));
    blocks_[block][i] = old;
    state_.PrepareForEvaluation(false, true);
    return residual;
  }

  // 2 x size, row-major; the other blocks' Jacobians are not asked for when only_this.
  std::vector<double> Jacobian(size_t block, bool only_this) {
    std::vector<std::vector<double>> values;
    std::vector<double*> pointers;
    for (const int32_t size : sizes()) values.emplace_back(2 * size);
    for (size_t i = 0; i < values.size(); ++i) {
      pointers.push_back(only_this && i != block ? nullptr : values[i].data());
    }
    Eigen::Vector2d residual;
    EXPECT_TRUE(cost_->Evaluate(blocks_.data(), residual.data(), pointers.data()));
    return values[block];
  }

 private:
  Reconstruction truth_;
  BundleState state_;
  Reprojection::Free free_;
  std::vector<double*> blocks_;
  std::unique_ptr<ReprojectionCost> cost_;
};

TEST(ReprojectionCost, JacobiansMatchCentralDifferences) {
  for (int model_id = 0; model_id < kNumCameraModels; ++model_id) {
    const CameraModel model = *CameraModelFromId(model_id);
    for (int mask = 1; mask < 32; ++mask) {
      BundleAdjustmentScope scope;
      scope.points = mask & 1;
      scope.rotations = mask & 2;
      scope.positions = mask & 4;
      scope.focal_lengths = mask & 8;
      scope.distortions = mask & 16;
      CostUnderTest cost(model, scope);
      for (size_t block = 0; block < cost.sizes().size(); ++block) {
        const std::vector<double> J = cost.Jacobian(block, false);
        EXPECT_EQ(J, cost.Jacobian(block, true));
        const int size = cost.sizes()[block];
        for (int i = 0; i < size; ++i) {
          const double h = 1e-5;
          const Eigen::Vector2d numeric =
              (cost.Residual(block, i, h) - cost.Residual(block, i, -h)) / (2 * h);
          for (int row = 0; row < 2; ++row) {
            EXPECT_NEAR(J[row * size + i], numeric[row], 1e-5 * (1 + std::abs(numeric[row])))
                << CameraModelName(model) << " scope " << mask << " block " << block << " column "
                << i;
          }
        }
      }
    }
  }
}

TEST(LeftJacobianSO3, IsAccurateNearZeroAndFarFromIt) {
  for (const double angle : {0.0, 1e-9, 1e-3, 9.99e-3, 1.001e-2, 0.5, 3.0}) {
    const Eigen::Vector3d omega = angle * Eigen::Vector3d(1, -2, 0.5).normalized();
    const Eigen::Vector3d y(0.3, 0.8, -1.1);
    const Eigen::Matrix3d J = -CrossMatrix(ExpSO3(omega) * y) * LeftJacobianSO3(omega);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d h = 1e-5 * Eigen::Vector3d::Unit(i);
      const Eigen::Vector3d numeric = (ExpSO3(omega + h) * y - ExpSO3(omega - h) * y) / 2e-5;
      EXPECT_LT((J.col(i) - numeric).norm(), 1e-9) << angle;
    }
  }
}

}  // namespace
}  // namespace cairn
