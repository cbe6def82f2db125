#include "cairn/scene/two_view_geometry.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "cairn/math/so3.h"
#include "support/test.h"

namespace cairn {
namespace {

TEST(Keypoint, FromScaleOrientationIsASimilarity) {
  const Keypoint keypoint =
      Keypoint::FromScaleOrientation(3, 4, 2, 0.5f * std::numbers::pi_v<float>);
  EXPECT_EQ(keypoint.Position(), Eigen::Vector2d(3, 4));
  Eigen::Matrix2d expected;  // x axis of the frame turned to the image's y axis
  expected << 0, -2, 2, 0;
  EXPECT_LT((keypoint.Shape() - expected).norm(), 1e-6);
}

TEST(TwoViewGeometry, InvertedExchangesTheImages) {
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kCalibrated;
  geometry.cam2_from_cam1 = Rigid3d(ExpSO3({0.1, 0.2, -0.3}), Eigen::Vector3d(0.6, 0, 0.8));
  geometry.E = CrossMatrix({0.6, 0, 0.8}) * geometry.cam2_from_cam1->RotationMatrix();
  geometry.F = Eigen::Matrix3d::Random();
  geometry.H = Eigen::Matrix3d::Random() + 3 * Eigen::Matrix3d::Identity();
  geometry.inlier_matches = {{1, 5}, {2, 7}};
  const TwoViewGeometry inverse = Inverted(geometry);
  EXPECT_EQ(inverse.config, geometry.config);
  EXPECT_EQ(inverse.inlier_matches, (FeatureMatches{{5, 1}, {7, 2}}));
  const Eigen::Vector3d x(0.2, 0.3, 2);
  EXPECT_LT((*inverse.cam2_from_cam1 * (*geometry.cam2_from_cam1 * x) - x).norm(), 1e-14);
  const Eigen::Vector3d a(1, 2, 1), b(-1, 0.5, 1);
  EXPECT_NEAR(a.dot(*inverse.F * b), b.dot(*geometry.F * a), 1e-14);
  EXPECT_NEAR(a.dot(*inverse.E * b), b.dot(*geometry.E * a), 1e-14);
  EXPECT_LT((*inverse.H * *geometry.H - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  const TwoViewGeometry twice = Inverted(inverse);
  EXPECT_LT((twice.cam2_from_cam1->translation - geometry.cam2_from_cam1->translation).norm(),
            1e-14);
  EXPECT_EQ(twice.inlier_matches, geometry.inlier_matches);
}

TEST(TwoViewGeometry, AbsentPartsStayAbsent) {
  const TwoViewGeometry inverse = Inverted({});
  EXPECT_FALSE(inverse.cam2_from_cam1 || inverse.E || inverse.F || inverse.H);
}

TEST(TwoViewGeometry, EveryConfigHasItsColmapNumberAndAName) {
  const char* names[] = {"undefined", "degenerate",          "calibrated", "uncalibrated", "planar",
                         "panoramic", "planar_or_panoramic", "watermark",  "multiple"};
  for (int i = 0; i < 9; ++i) {
    EXPECT_EQ(TwoViewConfigName(static_cast<TwoViewConfig>(i)), names[i]);
  }
  EXPECT_EQ(TwoViewConfigName(static_cast<TwoViewConfig>(99)), "unknown");
}

}  // namespace
}  // namespace cairn
