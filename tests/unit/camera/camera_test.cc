#include "cairn/camera/camera.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "cairn/base/rng.h"

namespace cairn {
namespace {

// One camera of every model, with noticeable distortion.
std::vector<Camera> AllCameras() {
  const std::vector<std::pair<CameraModel, std::vector<double>>> list = {
      {CameraModel::kSimplePinhole, {900, 512, 384}},
      {CameraModel::kPinhole, {900, 950, 500, 390}},
      {CameraModel::kSimpleRadial, {900, 512, 384, -0.12}},
      {CameraModel::kRadial, {900, 512, 384, -0.15, 0.06}},
      {CameraModel::kOpenCV, {900, 950, 500, 390, -0.15, 0.06, 0.002, -0.003}},
  };
  std::vector<Camera> cameras;
  for (const auto& [model, params] : list) {
    Camera camera = Camera::FromFocal(1, model, 900, 1024, 768);
    camera.params = params;
    cameras.push_back(camera);
  }
  return cameras;
}

TEST(Camera, NamesIdsAndCountsAreColmaps) {
  const std::tuple<const char*, int, int> models[] = {{"SIMPLE_PINHOLE", 0, 3},
                                                      {"PINHOLE", 1, 4},
                                                      {"SIMPLE_RADIAL", 2, 4},
                                                      {"RADIAL", 3, 5},
                                                      {"OPENCV", 4, 8}};
  for (const auto& [name, id, num_params] : models) {
    const auto model = CameraModelFromName(name);
    ASSERT_TRUE(model.has_value()) << name;
    EXPECT_EQ(static_cast<int>(*model), id);
    EXPECT_EQ(CameraModelFromId(id), model);
    EXPECT_EQ(CameraModelName(*model), name);
    EXPECT_EQ(CameraModelNumParams(*model), num_params);
    const Camera camera = Camera::FromFocal(3, *model, 700, 1000, 600);
    EXPECT_EQ(camera.Validate(), "");
    EXPECT_EQ(camera.FocalX(), 700);
    EXPECT_EQ(camera.FocalY(), 700);
    EXPECT_EQ(camera.PrincipalPoint(), Eigen::Vector2d(500, 300));
    EXPECT_EQ(camera.FocalIndices().size() + 2 + camera.DistortionIndices().size(),
              static_cast<size_t>(num_params));
  }
  EXPECT_FALSE(CameraModelFromName("FISHEYE").has_value());
  EXPECT_FALSE(CameraModelFromId(5).has_value());
  EXPECT_FALSE(CameraModelFromId(-1).has_value());
}

TEST(Camera, PinholeProjectionByHand) {
  Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, 100, 200, 100);
  camera.params = {100, 110, 99, 51};
  EXPECT_EQ(camera.ImgFromCam({0.5, -0.25}), Eigen::Vector2d(149, 23.5));
  Camera radial = Camera::FromFocal(1, CameraModel::kSimpleRadial, 100, 200, 100);
  radial.params[3] = 0.1;  // factor 1 + 0.1 * 0.25
  EXPECT_LT((radial.ImgFromCam({0.5, 0}) - Eigen::Vector2d(100 + 51.25, 50)).norm(), 1e-12);
}

TEST(Camera, JacobiansAreCentralDifferences) {
  Rng rng(1);
  for (const Camera& camera : AllCameras()) {
    const int n = CameraModelNumParams(camera.model);
    for (int trial = 0; trial < 50; ++trial) {
      const Eigen::Vector2d uv(rng.Uniform(-0.55, 0.55), rng.Uniform(-0.42, 0.42));
      Eigen::Matrix2d J_uv;
      std::vector<double> J_params(2 * n);
      camera.ImgFromCam(uv, &J_uv, J_params.data());
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector2d h = 1e-6 * Eigen::Vector2d::Unit(k);
        const Eigen::Vector2d difference =
            (camera.ImgFromCam(uv + h) - camera.ImgFromCam(uv - h)) / 2e-6;
        EXPECT_LT((difference - J_uv.col(k)).norm(), 1e-6) << CameraModelName(camera.model);
      }
      for (int k = 0; k < n; ++k) {
        Camera plus = camera, minus = camera;
        const double h = 1e-6 * std::max(1.0, std::abs(camera.params[k]));
        plus.params[k] += h;
        minus.params[k] -= h;
        const Eigen::Vector2d difference = (plus.ImgFromCam(uv) - minus.ImgFromCam(uv)) / (2 * h);
        const Eigen::Vector2d analytic(J_params[k], J_params[n + k]);
        EXPECT_LT((difference - analytic).norm(), 1e-6) << CameraModelName(camera.model) << k;
      }
    }
  }
}

TEST(Camera, CamFromImgInvertsUpToTheCornersAndBeyond) {
  for (const Camera& camera : AllCameras()) {
    for (double x = -30; x <= camera.width + 30; x += 37) {
      for (double y = -30; y <= camera.height + 30; y += 31) {
        Eigen::Matrix2d J;
        const auto uv = camera.CamFromImg({x, y}, &J);
        ASSERT_TRUE(uv.has_value()) << CameraModelName(camera.model) << " " << x << " " << y;
        Eigen::Matrix2d J_uv;
        const Eigen::Vector2d pixel = camera.ImgFromCam(*uv, &J_uv);
        EXPECT_LT((pixel - Eigen::Vector2d(x, y)).norm(), 1e-10);
        EXPECT_LT((J * J_uv - Eigen::Matrix2d::Identity()).norm(), 1e-10);
      }
    }
  }
}

// r (1 - 0.3 r^2) grows up to r = 1.054 (0.7027 distorted) and falls beyond: pixels farther out
// have no ray, and none of the mathematical solutions behind the fold may be returned.
TEST(Camera, PixelsBeyondTheFoldHaveNoRay) {
  Camera camera = Camera::FromFocal(1, CameraModel::kSimpleRadial, 500, 1000, 1000);
  camera.params[3] = -0.3;
  for (double radius = 0.0; radius < 10.0; radius += 0.01) {
    for (const double angle : {0.0, 0.3, 2.0, 4.0}) {
      const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
      const auto uv = camera.CamFromImg(camera.PrincipalPoint() + 500 * radius * direction);
      if (radius < 0.702) {
        ASSERT_TRUE(uv.has_value()) << radius;
        EXPECT_GE(uv->dot(direction), 0.999 * radius);
        EXPECT_LT(uv->norm(), 1.055);
      } else if (radius > 0.703) {
        EXPECT_FALSE(uv.has_value()) << radius << " gave " << uv->transpose();
      }
    }
  }
}

// With k1 < 0 < k2 the radius grows again far out: that branch is not the image of anything either.
TEST(Camera, OuterBranchIsNotReturned) {
  Camera camera = Camera::FromFocal(1, CameraModel::kRadial, 500, 1000, 1000);
  camera.params[3] = -0.5;
  camera.params[4] = 0.1;  // folds at r = 1 (0.6 distorted), grows again from r = 1.414
  for (double radius = 0.0; radius < 5.0; radius += 0.01) {
    const auto uv = camera.CamFromImg(camera.PrincipalPoint() + Eigen::Vector2d(500 * radius, 0));
    if (radius < 0.599) {
      ASSERT_TRUE(uv.has_value()) << radius;
      EXPECT_LT(uv->norm(), 1.0);
    } else if (radius > 0.601) {
      EXPECT_FALSE(uv.has_value()) << radius << " gave " << uv->transpose();
    }
  }
}

TEST(Camera, CalibrationMatrixFocalAndThreshold) {
  Camera camera = AllCameras()[1];
  Eigen::Matrix3d K;
  K << 900, 0, 500, 0, 950, 390, 0, 0, 1;
  EXPECT_EQ(camera.CalibrationMatrix(), K);
  const Eigen::Vector2d uv(0.2, -0.1);
  EXPECT_LT(((K * uv.homogeneous()).hnormalized() - camera.ImgFromCam(uv)).norm(), 1e-12);
  EXPECT_EQ(camera.MeanFocal(), 925);
  EXPECT_DOUBLE_EQ(camera.CamFromImgThreshold(1.85), 0.002);
  camera.SetMeanFocal(1850);
  EXPECT_DOUBLE_EQ(camera.FocalX(), 1800);
  EXPECT_DOUBLE_EQ(camera.FocalY(), 1900);
  EXPECT_DOUBLE_EQ(camera.DiagonalPx(), 1280);
}

TEST(Camera, IndicesPointAtTheirParameters) {
  const Camera camera = AllCameras()[4];
  EXPECT_EQ(camera.FocalIndices(), (std::vector<int>{0, 1}));
  EXPECT_EQ(camera.PrincipalPointIndices(), (std::vector<int>{2, 3}));
  EXPECT_EQ(camera.DistortionIndices(), (std::vector<int>{4, 5, 6, 7}));
  EXPECT_EQ(AllCameras()[3].DistortionIndices(), (std::vector<int>{3, 4}));
  EXPECT_EQ(AllCameras()[2].FocalIndices(), (std::vector<int>{0}));
}

TEST(Camera, ValidateNamesTheReason) {
  Camera camera = AllCameras()[0];
  EXPECT_EQ(camera.Validate(), "");
  Camera broken = camera;
  broken.width = 0;
  EXPECT_NE(broken.Validate(), "");
  broken = camera;
  broken.params.push_back(1);
  EXPECT_EQ(broken.Validate(), "SIMPLE_PINHOLE takes 3 parameters, not 4");
  broken = camera;
  broken.params[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(broken.Validate(), "a parameter is not finite");
  broken = camera;
  broken.params[0] = -900;
  EXPECT_EQ(broken.Validate(), "the focal length must be positive");
}

}  // namespace
}  // namespace cairn
