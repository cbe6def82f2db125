#include "cairn/synthetic/surface.h"

#include <Eigen/LU>

#include "cairn/synthetic/poses.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

Camera MakeCamera() {
  Camera camera = Camera::FromFocal(1, CameraModel::kOpenCV, 800, 1000, 750);
  camera.params = {800, 820, 503, 371, -0.05, 0.01, 0.001, -0.002};
  return camera;
}

SurfaceElement RandomElement(Rng& rng) {
  const Eigen::Vector3d point = UniformVector({{-0.5, 0.5}, {-0.5, 0.5}, {-0.5, 0.5}}, rng);
  const Eigen::Vector2d slope = 0.5 * GaussianVector<2>(rng);
  const Eigen::Vector3d normal(slope.x(), -1, slope.y());
  return MakeSurfaceElement(point, normal, 0.01, rng.Uniform(0, 6));
}

TEST(Surface, ElementHasOrthogonalAxesAndItsNormal) {
  const Eigen::Vector3d normal = Eigen::Vector3d(1, -2, 0.5).normalized();
  const SurfaceElement element = MakeSurfaceElement({1, 2, 3}, 7.0 * normal, 0.2, 1.1);
  EXPECT_NEAR(element.tangents.col(0).norm(), 0.2, 1e-15);
  EXPECT_NEAR(element.tangents.col(1).norm(), 0.2, 1e-15);
  EXPECT_NEAR(element.tangents.col(0).dot(element.tangents.col(1)), 0, 1e-15);
  EXPECT_LT((element.Normal() - normal).norm(), 1e-14);
}

TEST(Surface, ShapeAndGradientAreDerivativesOfTheProjection) {
  const Camera camera = MakeCamera();
  Rng rng(1);
  for (int i = 0; i < 200; ++i) {
    const Rigid3d pose = LookAt({rng.Uniform(-1, 1), -3, rng.Uniform(-1, 1)}, {0, 0, 0}, 0.3);
    const SurfaceElement element = RandomElement(rng);
    const auto center = Observe(camera, pose, element);
    ASSERT_TRUE(center.has_value());
    EXPECT_GT(center->shape.determinant(), 0);
    for (int k = 0; k < 2; ++k) {
      const double h = 1e-4;
      SurfaceElement plus = element, minus = element;
      plus.point += h * element.tangents.col(k);
      minus.point -= h * element.tangents.col(k);
      const auto a = Observe(camera, pose, plus);
      const auto b = Observe(camera, pose, minus);
      const Eigen::Vector2d shape_column = (a->pixel - b->pixel) / (2 * h);
      EXPECT_LT((shape_column - center->shape.col(k)).norm(), 1e-6);
      const double depth_derivative = (a->depth - b->depth) / (2 * h);
      EXPECT_NEAR(depth_derivative, center->depth_gradient.dot(center->shape.col(k)), 1e-8);
    }
  }
}

// The frame lifted by src/solvers/README.md is the element in the camera's frame.
TEST(Surface, LiftedObservationIsTheElement) {
  const Camera camera = MakeCamera();
  Rng rng(2);
  for (int i = 0; i < 200; ++i) {
    const Rigid3d pose = LookAt({rng.Uniform(-1, 1), -3, rng.Uniform(-1, 1)}, {0, 0, 0}, -0.2);
    const SurfaceElement element = RandomElement(rng);
    const auto view = Observe(camera, pose, element);
    ASSERT_TRUE(view.has_value());
    Eigen::Matrix2d J;
    const auto uv = camera.CamFromImg(view->pixel, &J);
    ASSERT_TRUE(uv.has_value());
    const Eigen::Vector3d q = uv->homogeneous();
    Eigen::Matrix<double, 3, 2> dq = Eigen::Matrix<double, 3, 2>::Zero();
    dq.topRows<2>() = J;
    const Eigen::Matrix<double, 3, 2> A =
        q * (view->depth_gradient * view->shape) + view->depth * dq * view->shape;
    EXPECT_LT((view->depth * q - pose * element.point).norm(), 1e-10);
    EXPECT_LT((A - pose.RotationMatrix() * element.tangents).norm(), 1e-10);
  }
}

TEST(Surface, BehindTheCameraAndEdgeOnAreAbsent) {
  const Camera camera = MakeCamera();
  const Rigid3d pose = LookAt({0, -3, 0}, {0, 0, 0});
  EXPECT_FALSE(Observe(camera, pose, MakeSurfaceElement({0, -4, 0}, {0, -1, 0}, 0.1, 0)));
  EXPECT_FALSE(Observe(camera, pose, MakeSurfaceElement({0, 0, 0}, {1, 0, 0}, 0.1, 0)));
  const auto back = Observe(camera, pose, MakeSurfaceElement({0, 0, 0}, {0, 1, 0}, 0.1, 0));
  ASSERT_TRUE(back.has_value());
  EXPECT_LT(back->shape.determinant(), 0);
}

TEST(Surface, NoiseHasTheStatedDeviation) {
  const Camera camera = MakeCamera();
  const Rigid3d pose = LookAt({0, -3, 0}, {0, 0, 0});
  const auto exact = Observe(camera, pose, MakeSurfaceElement({0.1, 0, 0}, {0.2, -1, 0}, 0.02, 1));
  const ObservationNoise noise{.image_px = 2, .affine = 0.1, .depth = 0.05, .depth_gradient = 0.3};
  const double size = std::sqrt(exact->shape.determinant());
  Rng rng(3);
  const int n = 20000;
  double image = 0, affine = 0, depth = 0, gradient = 0;
  for (int i = 0; i < n; ++i) {
    const AffineObservation noisy = AddNoise(*exact, noise, camera.MeanFocal(), rng);
    image += (noisy.pixel - exact->pixel).squaredNorm() / 2;
    affine += (noisy.shape - exact->shape).squaredNorm() / 4;
    depth += std::pow(noisy.depth - exact->depth, 2);
    gradient += (noisy.depth_gradient - exact->depth_gradient).squaredNorm() / 2;
  }
  EXPECT_NEAR(std::sqrt(image / n), 2, 0.05);
  EXPECT_NEAR(std::sqrt(affine / n), 0.1 * size, 0.003 * size);
  EXPECT_NEAR(std::sqrt(depth / n), 0.05 * exact->depth, 0.002 * exact->depth);
  EXPECT_NEAR(std::sqrt(gradient / n), 0.3 * exact->depth / camera.MeanFocal(),
              0.01 * exact->depth / camera.MeanFocal());
}

TEST(Poses, LookAtPutsTheTargetOnTheAxisAndUpUpwards) {
  const Eigen::Vector3d center(1, -2, 0.5), target(0.2, 0.1, 0.3);
  const Rigid3d pose = LookAt(center, target);
  EXPECT_LT((pose.Center() - center).norm(), 1e-14);
  const Eigen::Vector3d x = pose * target;
  EXPECT_LT(x.head<2>().norm(), 1e-14);
  EXPECT_NEAR(x.z(), (target - center).norm(), 1e-14);
  EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitZ()).y(), -0.9);  // y points down
  EXPECT_NEAR((pose.rotation * Eigen::Vector3d::UnitZ()).x(), 0, 1e-14);
}

TEST(Poses, EveryLayoutLooksAtTheScene) {
  for (const auto& [layout, name] : kCameraLayouts) {
    Rng rng(4, name);
    const auto poses = MakeCameraPoses(layout, 60, 3.0, rng);
    ASSERT_EQ(poses.size(), 60u);
    for (const Rigid3d& pose : poses) {
      const double along = layout == CameraLayout::kStreet ? pose.Center().x() : 0.0;
      const Eigen::Vector3d place = pose * Eigen::Vector3d(along, 0, 0);
      EXPECT_GT(place.z(), 0.9) << name;
      EXPECT_LT(place.head<2>().norm(), 0.8 * place.z()) << name;
    }
  }
}

}  // namespace
}  // namespace cairn
