#include "support/two_view_problem.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "cairn/geometry/epipolar.h"
#include "support/test.h"

namespace cairn {
namespace {

constexpr TwoViewLayout kLayouts[] = {TwoViewLayout::kPaper, TwoViewLayout::kRelief,
                                      TwoViewLayout::kPlane};

Eigen::Vector2d Normalized(const Camera& camera, const Eigen::Vector2d& pixel) {
  return *camera.CamFromImg(pixel);
}

TEST(TwoViewProblem, ExactObservationsFulfillTheEpipolarConstraint) {
  for (const TwoViewLayout layout : kLayouts) {
    const TwoViewProblem p = MakeTwoViewProblem({.layout = layout, .num_matches = 200}, 1);
    const Eigen::Matrix3d E = EssentialFromPose(p.cam2_from_cam1);
    ASSERT_EQ(p.matches.size(), 200u);
    for (size_t i = 0; i < p.matches.size(); ++i) {
      EXPECT_TRUE(p.is_inlier[i]);
      const double error = SquaredSampsonError(E, Normalized(p.camera1, p.exact1[i].pixel),
                                               Normalized(p.camera2, p.exact2[i].pixel));
      EXPECT_LT(error, 1e-24);
      EXPECT_GT(p.exact1[i].shape.determinant() * p.exact2[i].shape.determinant(), 0);
    }
  }
}

// a2 = ratio R a1 + ratio-scaled t and A2 = ratio R A1 (src/solvers/README.md) with depth maps of
// different scale.
TEST(TwoViewProblem, DepthRatioRelatesTheLiftedPoints) {
  const TwoViewProblem p =
      MakeTwoViewProblem({.num_matches = 50, .depth1_scale = 0.5, .depth2_scale = 3.0}, 2);
  EXPECT_DOUBLE_EQ(p.depth_ratio, 6.0);
  for (const FeatureMatch& match : p.matches) {
    const DepthSample& d1 = p.depth1[match.point1];
    const DepthSample& d2 = p.depth2[match.point2];
    const Eigen::Vector3d a1 =
        d1.depth * Normalized(p.camera1, p.observations1[match.point1].pixel).homogeneous();
    const Eigen::Vector3d a2 =
        d2.depth * Normalized(p.camera2, p.observations2[match.point2].pixel).homogeneous();
    const Eigen::Vector3d expected =
        p.depth_ratio * (p.cam2_from_cam1.rotation * a1) + 3.0 * p.cam2_from_cam1.translation;
    EXPECT_LT((a2 - expected).norm(), 1e-5);
  }
}

TEST(TwoViewProblem, LayoutsAreWhatTheySay) {
  const TwoViewProblem plane = MakeTwoViewProblem({.layout = TwoViewLayout::kPlane}, 3);
  for (const SurfaceElement& element : plane.elements) EXPECT_EQ(element.point.y(), 0.0);

  const TwoViewProblem wide = MakeTwoViewProblem({.baseline_angle_deg = 40}, 3);
  const Eigen::Vector3d c1 = wide.cam1_from_world.Center(), c2 = wide.cam2_from_world.Center();
  EXPECT_NEAR(AngleBetween(c1, c2) * 180 / std::numbers::pi, 40, 1e-9);
}

TEST(TwoViewProblem, OutliersAreTheChosenShareAndWrong) {
  const TwoViewProblem p = MakeTwoViewProblem({.num_matches = 400, .outlier_ratio = 0.3}, 4);
  EXPECT_EQ(std::count(p.is_inlier.begin(), p.is_inlier.end(), false), 120);
  EXPECT_EQ(p.elements.size(), 280u);
  const Eigen::Matrix3d E = EssentialFromPose(p.cam2_from_cam1);
  int num_large = 0;
  for (size_t i = 0; i < p.matches.size(); ++i) {
    const double error = SquaredSampsonError(E, Normalized(p.camera1, p.exact1[i].pixel),
                                             Normalized(p.camera2, p.exact2[i].pixel));
    if (p.is_inlier[i]) {
      EXPECT_LT(error, 1e-24);
    } else {
      num_large += std::sqrt(error) * 1100 > 2;
    }
  }
  EXPECT_GT(num_large, 100);
}

TEST(TwoViewProblem, EachKeypointIsUsedOnceAndMissingDepthIsMarked) {
  const TwoViewProblem p = MakeTwoViewProblem({.num_matches = 500, .missing_depth_ratio = 0.4}, 5);
  std::set<point2D_t> used1, used2;
  for (const FeatureMatch& match : p.matches) {
    EXPECT_TRUE(used1.insert(match.point1).second);
    EXPECT_TRUE(used2.insert(match.point2).second);
  }
  EXPECT_EQ(*used1.rbegin(), 499u);
  const auto num_valid = std::count_if(p.depth1.begin(), p.depth1.end(),
                                       [](const DepthSample& d) { return d.is_valid; });
  EXPECT_NEAR(num_valid, 300, 50);
}

TEST(TwoViewProblem, NoiseMovesObservationsOnly) {
  TwoViewProblemOptions options;
  const TwoViewProblem exact = MakeTwoViewProblem(options, 6);
  options.noise = {.image_px = 1, .affine = 0.1, .depth = 0.1, .depth_gradient = 0.1};
  const TwoViewProblem noisy = MakeTwoViewProblem(options, 6);
  ASSERT_EQ(exact.matches.size(), noisy.matches.size());
  for (size_t i = 0; i < exact.matches.size(); ++i) {
    const point2D_t k = noisy.matches[i].point1;
    EXPECT_EQ(exact.observations1[exact.matches[i].point1].pixel, exact.exact1[i].pixel);
    EXPECT_EQ(exact.exact1[i].pixel, noisy.exact1[i].pixel);
    EXPECT_NE(noisy.exact1[i].pixel, noisy.observations1[k].pixel);
    EXPECT_NE(noisy.exact1[i].shape, noisy.observations1[k].shape);
    EXPECT_NE(noisy.exact1[i].depth, noisy.observations1[k].depth);
    EXPECT_NE(noisy.exact1[i].depth_gradient, noisy.observations1[k].depth_gradient);
  }
}

TEST(TwoViewProblem, SameSeedSameProblem) {
  const TwoViewProblem a = MakeTwoViewProblem({.outlier_ratio = 0.5}, 7);
  const TwoViewProblem b = MakeTwoViewProblem({.outlier_ratio = 0.5}, 7);
  const TwoViewProblem c = MakeTwoViewProblem({.outlier_ratio = 0.5}, 8);
  EXPECT_EQ(a.keypoints1, b.keypoints1);
  EXPECT_EQ(a.keypoints2, b.keypoints2);
  EXPECT_EQ(a.matches, b.matches);
  EXPECT_NE(a.keypoints1, c.keypoints1);
}

}  // namespace
}  // namespace cairn
