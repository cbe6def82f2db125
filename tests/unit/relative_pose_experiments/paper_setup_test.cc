#include "relative_pose_experiments/paper_setup.h"

#include "relative_pose_experiments/solver_runs.h"
#include "support/test.h"

namespace cairn::experiments {
namespace {

TEST(PaperSetup, IsThePapers) {
  for (int i = 0; i < 200; ++i) {
    const Instance instance = MakeInstance(0, i);
    EXPECT_EQ(instance.camera.MeanFocal(), 600.0);
    EXPECT_EQ(instance.camera.PrincipalPoint(), Eigen::Vector2d(300, 300));
    EXPECT_LT(instance.cam2_from_cam1.translation.norm(), 4.0);  // both within 2 of the origin
    ASSERT_EQ(instance.view1.size(), kNumSampled + kNumOthers);
    for (size_t k = 0; k < instance.view1.size(); ++k) {
      EXPECT_GT(instance.view1[k].depth, 0);
      EXPECT_GT(instance.view2[k].depth, 0);
      EXPECT_GT(instance.view1[k].shape.determinant() * instance.view2[k].shape.determinant(), 0);
    }
  }
}

TEST(PaperSetup, EveryCorrespondenceFulfilsTheConstraints) {
  for (int i = 0; i < 200; ++i) {
    const Instance instance = MakeInstance(1, i);
    const double scale = instance.depth2_unit / instance.depth1_unit;
    const Eigen::Matrix3d R = instance.cam2_from_cam1.RotationMatrix();
    const Eigen::Vector3d t = instance.depth2_unit * instance.cam2_from_cam1.translation;
    for (int k = 0; k < kNumSampled; ++k) {
      const auto [frame1, frame2] = LiftedOf(instance, k);
      EXPECT_TRUE(frame2.point.isApprox(scale * R * frame1.point + t, 1e-9));
      EXPECT_TRUE(frame2.derivative.isApprox(scale * R * frame1.derivative, 1e-9));
      // Unit, orthogonal axes in the plane of the surface.
      const Eigen::Matrix2d gram = frame1.derivative.transpose() * frame1.derivative;
      EXPECT_TRUE(
          gram.isApprox(std::pow(instance.depth1_unit, 2) * Eigen::Matrix2d::Identity(), 1e-9));
    }
  }
}

TEST(PaperSetup, DoesNotDependOnTheNumberOfThreads) {
  const auto one = MakeInstances(2, 300, 1);
  const auto many = MakeInstances(2, 300, 4);
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].view1[0].pixel, many[i].view1[0].pixel);
    EXPECT_EQ(one[i].view2[14].depth_gradient, many[i].view2[14].depth_gradient);
  }
  EXPECT_NE(MakeInstance(3, 0).view1[0].pixel, one[0].view1[0].pixel);
}

TEST(PaperSetup, NoiseGrowsWithItsLevelAndSparesWhatIsNotNoisy) {
  const Instance exact = MakeInstance(4, 0);
  EXPECT_EQ(WithNoise(exact, {}, 4, 0).view1[0].pixel, exact.view1[0].pixel);
  const Instance small = WithNoise(exact, {.image_px = 1}, 4, 0);
  const Instance large = WithNoise(exact, {.image_px = 2}, 4, 0);
  EXPECT_TRUE((large.view1[0].pixel - exact.view1[0].pixel)
                  .isApprox(2 * (small.view1[0].pixel - exact.view1[0].pixel), 1e-9));
  EXPECT_EQ(small.view1[0].shape, exact.view1[0].shape);
  EXPECT_EQ(small.view1[0].depth, exact.view1[0].depth);
  const Instance depth = WithNoise(exact, {.depth = 0.1}, 4, 0);
  EXPECT_EQ(depth.view2[0].pixel, exact.view2[0].pixel);
  EXPECT_NE(depth.view2[0].depth, exact.view2[0].depth);
  EXPECT_NE(depth.view2[0].depth_gradient, exact.view2[0].depth_gradient);
}

}  // namespace
}  // namespace cairn::experiments
