#include "cairn/solvers/one_affine_depth.h"

#include <algorithm>
#include <vector>

#include "cairn/solvers/one_affine_depth_batch.h"
#include "support/random_two_view.h"
#include "support/test.h"

namespace cairn {
namespace {

template <class Solver>
class OneAffineDepth : public ::testing::Test {};
using Solvers = ::testing::Types<OneAffineDepthProposed, OneAffineDepthUmeyama>;
TYPED_TEST_SUITE(OneAffineDepth, Solvers);

TYPED_TEST(OneAffineDepth, IsExact) {
  Rng rng(1);
  for (int trial = 0; trial < 2000; ++trial) {
    const TwoViewScene scene = RandomScene(rng, 1, 3.1);
    ScaledPose model;
    ASSERT_EQ(TypeParam::Solve(&scene.patches[0].lifted, &model), 1);
    EXPECT_LT(AngleBetween(model.cam2_from_cam1.rotation, scene.cam2_from_cam1.rotation), 1e-9);
    EXPECT_NEAR(model.scale, scene.depth_scale, 1e-9 * scene.depth_scale);
    EXPECT_LT(
        (model.cam2_from_cam1.translation - scene.depth_scale * scene.cam2_from_cam1.translation)
            .norm(),
        1e-9);
  }
}

TYPED_TEST(OneAffineDepth, SwappedImagesInvertThePose) {
  Rng rng(2);
  for (int trial = 0; trial < 200; ++trial) {
    const TwoViewScene scene = RandomScene(rng, 1);
    const LiftedCorrespondence& there = scene.patches[0].lifted;
    const LiftedCorrespondence back{there.frame2, there.frame1};
    ScaledPose model, inverse;
    ASSERT_EQ(TypeParam::Solve(&there, &model), 1);
    ASSERT_EQ(TypeParam::Solve(&back, &inverse), 1);
    EXPECT_LT(PoseError(inverse.cam2_from_cam1, Inverse(model.cam2_from_cam1)), 1e-9);
    EXPECT_NEAR(inverse.scale * model.scale, 1.0, 1e-9);
  }
}

TYPED_TEST(OneAffineDepth, TheUnitOfADepthMapChangesOnlyScaleAndLengthOfTranslation) {
  Rng rng(3);
  const TwoViewScene scene = RandomScene(rng, 1);
  LiftedCorrespondence sample = scene.patches[0].lifted;
  ScaledPose model, scaled;
  ASSERT_EQ(TypeParam::Solve(&sample, &model), 1);
  sample.frame1.point *= 10.0;
  sample.frame1.derivative *= 10.0;
  ASSERT_EQ(TypeParam::Solve(&sample, &scaled), 1);
  EXPECT_LT(PoseError(model.cam2_from_cam1, scaled.cam2_from_cam1), 1e-9);
  EXPECT_NEAR(scaled.scale, model.scale / 10.0, 1e-9);
}

TYPED_TEST(OneAffineDepth, RejectsWhatCannotBeOneSurface) {
  Rng rng(4);
  const LiftedCorrespondence good = RandomScene(rng, 1).patches[0].lifted;
  ScaledPose model;
  LiftedCorrespondence mirrored = good;
  mirrored.frame2.derivative.col(0) *= -1.0;
  EXPECT_EQ(TypeParam::Solve(&mirrored, &model), 0);
  LiftedCorrespondence behind = good;
  behind.frame1.point *= -1.0;
  EXPECT_EQ(TypeParam::Solve(&behind, &model), 0);
  LiftedCorrespondence singular = good;
  singular.frame1.derivative.col(1) = 2.0 * singular.frame1.derivative.col(0);
  EXPECT_EQ(TypeParam::Solve(&singular, &model), 0);
  LiftedCorrespondence zero = good;
  zero.frame2.derivative.setZero();
  EXPECT_EQ(TypeParam::Solve(&zero, &model), 0);
}

TEST(OneAffineDepthProposed, KeepsTheSecondAxisExactly) {
  Rng rng(5);
  LiftedCorrespondence sample = RandomScene(rng, 1).patches[0].lifted;
  sample.frame2.derivative.col(0) += 0.2 * sample.frame2.derivative.col(1);
  ScaledPose model;
  ASSERT_EQ(OneAffineDepthProposed::Solve(&sample, &model), 1);
  const Eigen::Vector3d axis1 = sample.frame1.derivative.col(1);
  EXPECT_LT(AngleBetween(Eigen::Vector3d(model.cam2_from_cam1.rotation * axis1),
                         Eigen::Vector3d(sample.frame2.derivative.col(1))),
            1e-9);
}

TEST(OneAffineDepthUmeyama, IsTheLeastSquaresFit) {
  Rng rng(6);
  LiftedCorrespondence sample = RandomScene(rng, 1).patches[0].lifted;
  sample.frame2.derivative.col(0) += 0.2 * sample.frame2.derivative.col(1);
  ScaledPose model;
  ASSERT_EQ(OneAffineDepthUmeyama::Solve(&sample, &model), 1);
  auto cost = [&](const Eigen::Quaterniond& R, double scale) {
    return (sample.frame2.derivative - scale * (R.toRotationMatrix() * sample.frame1.derivative))
        .squaredNorm();
  };
  const double best = cost(model.cam2_from_cam1.rotation, model.scale);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Quaterniond R =
        ExpSO3(1e-3 * RandomDirection(rng)) * model.cam2_from_cam1.rotation;
    EXPECT_GE(cost(R, model.scale * (1.0 + rng.Uniform(-1e-3, 1e-3))), best);
  }
}

TEST(OneAffineDepthBatch, AgreesWithTheSolverOneByOne) {
  Rng rng(7);
  OneAffineDepthBatch batch;
  for (const int n : {0, 1, 15, 16, 100, 33}) {
    batch.Reset(n);
    std::vector<LiftedCorrespondence> samples;
    for (int i = 0; i < n; ++i) {
      samples.push_back(RandomScene(rng, 1, 3.1).patches[0].lifted);
      if (i % 7 == 3) samples.back().frame2.derivative.col(0) *= -1.0;
      if (i % 7 == 4) samples.back().frame1.point *= -1.0;
      if (i % 7 == 5) samples.back().frame1.derivative.setZero();
      batch.Set(i, samples.back().frame1, samples.back().frame2);
    }
    batch.Solve();
    int num_good = 0;
    for (int i = 0; i < n; ++i) {
      ScaledPose expected;
      Eigen::Matrix3d R;
      Eigen::Vector3d t;
      const bool is_good = batch.Get(i, &R, &t);
      ASSERT_EQ(is_good, OneAffineDepthProposed::Solve(&samples[i], &expected) == 1);
      if (!is_good) continue;
      ++num_good;
      EXPECT_LT((R - expected.cam2_from_cam1.RotationMatrix()).norm(), 1e-5);
      EXPECT_LT((t - expected.cam2_from_cam1.translation.normalized()).norm(), 1e-4);
    }
    EXPECT_GE(num_good, n / 2);
  }
}

TEST(OneAffineDepthBatch, HasNoPoseWhereFloatsOverflow) {
  Rng rng(7);
  LiftedCorrespondence sample = RandomScene(rng, 1, 3.1).patches[0].lifted;
  OneAffineDepthBatch batch;
  batch.Reset(2);
  batch.Set(0, sample.frame1, sample.frame2);
  sample.frame1.point *= 1e12;  // far away, and of no size
  sample.frame1.derivative *= 1e-9;
  batch.Set(1, sample.frame1, sample.frame2);
  batch.Solve();
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  EXPECT_TRUE(batch.Get(0, &R, &t));
  EXPECT_FALSE(batch.Get(1, &R, &t)) << t;
}

// Lifting through a camera with distortion, against a surface and numeric derivatives.
TEST(LiftFrame, AgreesWithASurface) {
  Camera camera;
  camera.camera_id = 1;
  camera.model = CameraModel::kRadial;
  camera.width = 1000;
  camera.height = 800;
  camera.params = {900.0, 510.0, 390.0, -0.1, 0.02};
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.2, 1.0).normalized();
  const double distance = 4.0;
  auto point_at = [&](const Eigen::Vector2d& pixel) {
    const Eigen::Vector3d ray = camera.CamFromImg(pixel)->homogeneous();
    return Eigen::Vector3d(ray * (distance / normal.dot(ray)));
  };
  const Eigen::Vector2d pixel(200.0, 650.0);
  Eigen::Matrix2d shape;
  shape << 3.0, -1.0, 0.5, 2.0;
  constexpr double kStep = 1e-4;
  Eigen::RowVector2d gradient;
  Eigen::Matrix<double, 3, 2> expected;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d h = kStep * Eigen::Vector2d::Unit(k);
    gradient[k] = (point_at(pixel + h).z() - point_at(pixel - h).z()) / (2.0 * kStep);
    const Eigen::Vector2d axis = kStep * shape.col(k);
    expected.col(k) = (point_at(pixel + axis) - point_at(pixel - axis)) / (2.0 * kStep);
  }
  const auto lifted = LiftFrame(camera, pixel, shape, point_at(pixel).z(), gradient);
  ASSERT_TRUE(lifted.has_value());
  EXPECT_LT((lifted->point - point_at(pixel)).norm(), 1e-12);
  EXPECT_LT((lifted->derivative - expected).norm(), 1e-7);
}

TEST(LiftFrame, IsAbsentWhereTheCameraCannotUndistort) {
  Camera camera;
  camera.camera_id = 1;
  camera.model = CameraModel::kSimpleRadial;
  camera.width = camera.height = 1000;
  camera.params = {500.0, 500.0, 500.0, -1.0};
  EXPECT_FALSE(
      LiftFrame(camera, {0.5, 0.5}, Eigen::Matrix2d::Identity(), 1.0, Eigen::RowVector2d::Zero())
          .has_value());
}

}  // namespace
}  // namespace cairn
