#include "cairn/geometry/rigid3d.h"

#include <cmath>
#include <numbers>

#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "support/test.h"

namespace cairn {
namespace {

Eigen::Vector3d RandomTranslation(Rng& rng) {
  return {rng.Gaussian(), rng.Gaussian(), rng.Gaussian()};
}
Rigid3d RandomRigid(Rng& rng) { return {ExpSO3(RandomTranslation(rng)), RandomTranslation(rng)}; }
Sim3d RandomSim(Rng& rng) {
  return {std::exp(rng.Gaussian()), ExpSO3(RandomTranslation(rng)), RandomTranslation(rng)};
}

TEST(Rigid3d, GroupLaws) {
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    const Rigid3d b_from_a = RandomRigid(rng), c_from_b = RandomRigid(rng);
    const Eigen::Vector3d x = RandomTranslation(rng);
    EXPECT_LT(((c_from_b * b_from_a) * x - c_from_b * (b_from_a * x)).norm(), 1e-13);
    EXPECT_LT((Inverse(b_from_a) * (b_from_a * x) - x).norm(), 1e-13);
    EXPECT_LT((b_from_a * (Inverse(b_from_a) * x) - x).norm(), 1e-13);
    const Rigid3d from_matrix(b_from_a.RotationMatrix(), b_from_a.translation);
    EXPECT_LT((from_matrix * x - b_from_a * x).norm(), 1e-13);
    EXPECT_LT((b_from_a * x - (b_from_a.RotationMatrix() * x + b_from_a.translation)).norm(),
              1e-13);
  }
}

TEST(Rigid3d, CenterIsTheCamerasOriginInTheWorld) {
  Rng rng(2);
  const Rigid3d cam_from_world = RandomRigid(rng);
  EXPECT_LT((cam_from_world * cam_from_world.Center()).norm(), 1e-14);
  EXPECT_LT((Inverse(cam_from_world).translation - cam_from_world.Center()).norm(), 1e-14);
}

TEST(Sim3d, InverseAndTransformedCameras) {
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const Sim3d new_from_old = RandomSim(rng);
    const Eigen::Vector3d x = RandomTranslation(rng);
    EXPECT_LT((Inverse(new_from_old) * (new_from_old * x) - x).norm(), 1e-12);
    // The camera sees the moved point where it saw the old one; its frame is scaled.
    const Rigid3d cam_from_old = RandomRigid(rng);
    const Rigid3d cam_from_new = TransformCameraWorld(new_from_old, cam_from_old);
    EXPECT_LT((cam_from_new * (new_from_old * x) - new_from_old.scale * (cam_from_old * x)).norm(),
              1e-12);
  }
}

TEST(Angle, OfRotationsIsExactNearZeroAndPi) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -1).normalized();
  for (const double angle : {0.0, 1e-14, 1e-8, 1e-3, 1.0, 3.1}) {
    EXPECT_NEAR(RotationAngle(ExpSO3(angle * axis)), angle, 1e-15 + 1e-14 * angle);
    const Eigen::Quaterniond a = ExpSO3({0.3, -0.2, 0.9});
    EXPECT_NEAR(AngleBetween(a, Eigen::Quaterniond(a * ExpSO3(angle * axis))), angle,
                5e-16 + 1e-14 * angle);
  }
  EXPECT_NEAR(RotationAngle(Eigen::Quaterniond(-1, 0, 0, 0)), 0, 1e-15);
  EXPECT_NEAR(RotationAngle(ExpSO3(std::numbers::pi * axis)), std::numbers::pi, 1e-14);
}

TEST(Angle, OfDirectionsIsExactNearZeroAndPi) {
  const Eigen::Vector3d a(0.3, -0.4, 2);
  const Eigen::Vector3d normal = a.unitOrthogonal();
  for (const double angle : {0.0, 1e-12, 1e-8, 1.0, std::numbers::pi - 1e-8, std::numbers::pi}) {
    const Eigen::Vector3d b = 5.0 * (ExpSO3(angle * normal) * a);
    EXPECT_NEAR(AngleBetween(a, b), angle, 1e-15 + 1e-15 * angle);
  }
  EXPECT_EQ(AngleBetween(a, Eigen::Vector3d(0, 0, 0)), std::numbers::pi);
  EXPECT_EQ(AngleBetween(Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 0, 0)), 0.0);
}

}  // namespace
}  // namespace cairn
