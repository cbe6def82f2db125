#include "cairn/camera/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numbers>

#include "cairn/base/rng.h"
#include "math/random_vectors.h"
#include "support/test.h"

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
      {CameraModel::kFullOpenCV,
       {900, 950, 500, 390, 0.3, 0.1, 0.002, -0.003, 0.02, 0.5, 0.1, 0.01}},
      {CameraModel::kOpenCVFisheye, {300, 310, 500, 390, 0.05, -0.01, 0.004, -0.0008}},
      {CameraModel::kFov, {300, 310, 500, 390, 0.9}},
      {CameraModel::kSimpleRadialFisheye, {300, 512, 384, -0.03}},
      {CameraModel::kRadialFisheye, {300, 512, 384, -0.03, 0.004}},
      {CameraModel::kThinPrismFisheye,
       {300, 310, 500, 390, 0.05, -0.01, 0.002, -0.001, 0.004, -0.0008, 0.003, -0.002}},
      {CameraModel::kRadTanThinPrismFisheye,
       {300, 310, 500, 390, 0.4, -0.5, 0.3, -0.1, 0.02, -0.001, 0.002, -0.001, 0.001, -0.0003,
        0.0008, 0.0002}},
      {CameraModel::kSimpleDivision, {300, 512, 384, -0.4}},
      {CameraModel::kDivision, {300, 310, 500, 390, 0.05}},
      {CameraModel::kSimpleFisheye, {300, 512, 384}},
      {CameraModel::kFisheye, {300, 310, 500, 390}},
      {CameraModel::kEucm, {300, 310, 500, 390, 0.6, 1.1}},
      {CameraModel::kEquirectangular, {1024, 768}},
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
                                                      {"OPENCV", 4, 8},
                                                      {"OPENCV_FISHEYE", 5, 8},
                                                      {"FULL_OPENCV", 6, 12},
                                                      {"FOV", 7, 5},
                                                      {"SIMPLE_RADIAL_FISHEYE", 8, 4},
                                                      {"RADIAL_FISHEYE", 9, 5},
                                                      {"THIN_PRISM_FISHEYE", 10, 12},
                                                      {"RAD_TAN_THIN_PRISM_FISHEYE", 11, 16},
                                                      {"SIMPLE_DIVISION", 12, 4},
                                                      {"DIVISION", 13, 5},
                                                      {"SIMPLE_FISHEYE", 14, 3},
                                                      {"FISHEYE", 15, 4},
                                                      {"EUCM", 16, 6}};
  for (const auto& [name, id, num_params] : models) {
    const auto model = CameraModelFromName(name);
    ASSERT_TRUE(model.has_value()) << name;
    EXPECT_EQ(static_cast<int>(*model), id);
    EXPECT_EQ(CameraModelFromId(id), model);
    EXPECT_EQ(CameraModelName(*model), name);
    EXPECT_EQ(NamedCameraModels()[id].name, name);
    EXPECT_EQ(CameraModelNumParams(*model), num_params);
    const Camera camera = Camera::FromFocal(3, *model, 700, 1000, 600);
    EXPECT_EQ(camera.Validate(), "");
    EXPECT_EQ(camera.FocalX(), 700);
    EXPECT_EQ(camera.FocalY(), 700);
    EXPECT_EQ(camera.PrincipalPoint(), Eigen::Vector2d(500, 300));
    EXPECT_EQ(camera.FocalIndices().size() + 2 + camera.DistortionIndices().size(),
              static_cast<size_t>(num_params));
    // Without distortion, all are pinholes near the axis.
    const auto pixel = camera.ImgFromRay({0.001, -0.002, 1});
    ASSERT_TRUE(pixel.has_value());
    EXPECT_LT((*pixel - Eigen::Vector2d(500.7, 298.6)).norm(), 1e-4) << name;
  }
  EXPECT_FALSE(CameraModelFromName("CYLINDER").has_value());
  EXPECT_FALSE(CameraModelFromId(18).has_value());
  EXPECT_FALSE(CameraModelFromId(-1).has_value());
}

TEST(Camera, EquirectangularHasNothingButItsSize) {
  Camera camera = Camera::FromFocal(3, CameraModel::kEquirectangular, 700, 2000, 1000);
  EXPECT_EQ(CameraModelFromName("EQUIRECTANGULAR"), camera.model);
  EXPECT_EQ(CameraModelFromId(17), camera.model);
  EXPECT_EQ(camera.params, (std::vector<double>{2000, 1000}));
  EXPECT_EQ(camera.Validate(), "");
  EXPECT_THAT(camera.FocalIndices(), IsEmpty());
  EXPECT_THAT(camera.PrincipalPointIndices(), IsEmpty());
  EXPECT_THAT(camera.DistortionIndices(), IsEmpty());
  camera.SetMeanFocal(500);
  EXPECT_NEAR(camera.MeanFocal(), 1000 / std::numbers::pi, 1e-9);
  EXPECT_EQ(camera.PrincipalPoint(), Eigen::Vector2d(1000, 500));
  // Forward, right, left, down; nearly behind to the right.
  const std::pair<Eigen::Vector3d, Eigen::Vector2d> pairs[] = {{{0, 0, 2}, {1000, 500}},
                                                               {{2, 0, 0}, {1500, 500}},
                                                               {{-2, 0, 0}, {500, 500}},
                                                               {{0, 1, 1}, {1000, 750}},
                                                               {{1e-9, 0, -1}, {2000, 500}}};
  for (const auto& [point, expected] : pairs) {
    EXPECT_LT((*camera.ImgFromRay(point) - expected).norm(), 1e-5) << point.transpose();
  }
}

TEST(Camera, PinholeProjectionByHand) {
  Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, 100, 200, 100);
  camera.params = {100, 110, 99, 51};
  EXPECT_EQ(camera.ImgFromCam({0.5, -0.25}), Eigen::Vector2d(149, 23.5));
  Camera radial = Camera::FromFocal(1, CameraModel::kSimpleRadial, 100, 200, 100);
  radial.params[3] = 0.1;  // factor 1 + 0.1 * 0.25
  EXPECT_LT((radial.ImgFromCam({0.5, 0}) - Eigen::Vector2d(100 + 51.25, 50)).norm(), 1e-12);
}

// Where project(camera) moves with each parameter, by central differences, against J (2 x n).
template <class Project>
void ExpectParamJacobian(const Camera& camera, const std::vector<double>& J, double tolerance,
                         const Project& project) {
  const size_t n = camera.params.size();
  for (size_t k = 0; k < n; ++k) {
    Camera plus = camera, minus = camera;
    const double h = 1e-6 * std::max(1.0, std::abs(camera.params[k]));
    plus.params[k] += h;
    minus.params[k] -= h;
    const Eigen::Vector2d difference = (project(plus) - project(minus)) / (2 * h);
    const Eigen::Vector2d analytic(J[k], J[n + k]);
    EXPECT_LT((difference - analytic).norm(), tolerance * (1 + analytic.norm()))
        << CameraModelName(camera.model) << k;
  }
}

TEST(Camera, JacobiansAreCentralDifferences) {
  Rng rng(1);
  for (const Camera& camera : AllCameras()) {
    const int n = CameraModelNumParams(camera.model);
    for (int trial = 0; trial < 50; ++trial) {
      const Eigen::Vector2d uv = UniformVector({{-0.55, 0.55}, {-0.42, 0.42}}, rng);
      Eigen::Matrix2d J_uv;
      std::vector<double> J_params(2 * n);
      camera.ImgFromCam(uv, &J_uv, J_params.data());
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector2d h = 1e-6 * Eigen::Vector2d::Unit(k);
        const Eigen::Vector2d difference =
            (camera.ImgFromCam(uv + h) - camera.ImgFromCam(uv - h)) / 2e-6;
        EXPECT_LT((difference - J_uv.col(k)).norm(), 1e-6) << CameraModelName(camera.model);
      }
      ExpectParamJacobian(camera, J_params, 1e-6,
                          [&](const Camera& moved) { return moved.ImgFromCam(uv); });
    }
  }
}

// Directions up to max_angle (radians) off axis, at some distance.
Eigen::Vector3d RandomPoint(double max_angle, Rng& rng) {
  const double angle = rng.Uniform(0, max_angle), around = rng.Uniform(0, 2 * std::numbers::pi);
  return rng.Uniform(0.2, 5) * Eigen::Vector3d(std::sin(angle) * std::cos(around),
                                               std::sin(angle) * std::sin(around), std::cos(angle));
}

// How far off axis the models of AllCameras reach, radians.
double Field(const Camera& camera) {
  switch (camera.model) {
    case CameraModel::kEquirectangular:
    case CameraModel::kSimpleFisheye:
    case CameraModel::kFisheye:
      return 3.0;
    case CameraModel::kDivision:
      return 1.1;  // tan < 1 / (2 sqrt(k))
    case CameraModel::kFov:
      return 2.8;
    case CameraModel::kSimpleDivision:
      return 2.5;
    case CameraModel::kOpenCVFisheye:
    case CameraModel::kThinPrismFisheye:
      return 1.7;
    case CameraModel::kRadTanThinPrismFisheye:
      return 1.2;
    case CameraModel::kEucm:
    case CameraModel::kSimpleRadialFisheye:
    case CameraModel::kRadialFisheye:
      return 2.0;
    default:
      return 0.6;
  }
}

TEST(Camera, RayJacobiansAreCentralDifferences) {
  Rng rng(2);
  for (const Camera& camera : AllCameras()) {
    const int n = CameraModelNumParams(camera.model);
    for (int trial = 0; trial < 200; ++trial) {
      // Some on the axis, and so near it that quotients come from their series.
      const double field = trial == 0 ? 0 : trial < 20 ? 1e-3 : Field(camera);
      const Eigen::Vector3d x = RandomPoint(field, rng);
      Eigen::Matrix<double, 2, 3> J;
      const auto pixel = camera.ImgFromRay(x, &J);
      ASSERT_TRUE(pixel.has_value()) << CameraModelName(camera.model) << x.transpose();
      const double scale = 1000 / x.norm();
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d h = 1e-5 * x.norm() * Eigen::Vector3d::Unit(k);
        const Eigen::Vector2d difference =
            (*camera.ImgFromRay(x + h) - *camera.ImgFromRay(x - h)) / (2e-5 * x.norm());
        EXPECT_LT((difference - J.col(k)).norm(), 1e-5 * scale)
            << CameraModelName(camera.model) << " " << x.transpose();
      }
      std::vector<double> J_params(2 * n);
      Eigen::Vector2d same;
      ASSERT_TRUE(ImgFromRay({camera.model, camera.params.data()}, x.data(), same.data(), nullptr,
                             J_params.data()));
      EXPECT_EQ(same, *pixel);
      ExpectParamJacobian(camera, J_params, 1e-5,
                          [&](const Camera& moved) { return *moved.ImgFromRay(x); });
    }
  }
}

TEST(Camera, RayFromImgInvertsOverTheWholeField) {
  Rng rng(3);
  for (const Camera& camera : AllCameras()) {
    for (int trial = 0; trial < 1000; ++trial) {
      const Eigen::Vector3d x = RandomPoint(Field(camera), rng);
      const auto pixel = camera.ImgFromRay(x);
      ASSERT_TRUE(pixel.has_value()) << CameraModelName(camera.model) << x.transpose();
      const auto ray = camera.RayFromImg(*pixel);
      ASSERT_TRUE(ray.has_value()) << CameraModelName(camera.model) << " " << x.transpose();
      EXPECT_LT((*ray - x.normalized()).norm(), 1e-8)
          << CameraModelName(camera.model) << " " << x.transpose();
      EXPECT_NEAR(ray->norm(), 1, 1e-12);
      const auto uv = camera.CamFromImg(*pixel);
      EXPECT_EQ(uv.has_value(), ray->z() > 0);
      if (uv && ray->z() > 0.1) {
        EXPECT_LT((*uv - x.hnormalized()).norm(), 1e-6);
        EXPECT_LT((camera.ImgFromCam(*uv) - *pixel).norm(), 1e-6);
      }
    }
  }
}

TEST(Camera, RadiansPerPxAreThoseOfSmallSquares) {
  Rng rng(4);
  for (const Camera& camera : AllCameras()) {
    for (int trial = 0; trial < 50; ++trial) {
      const Eigen::Vector3d x = RandomPoint(0.9 * Field(camera), rng);
      const Eigen::Vector2d pixel = *camera.ImgFromRay(x);
      constexpr double kSide = 1e-3;
      const Eigen::Vector3d ray = *camera.RayFromImg(pixel);
      const Eigen::Vector3d right = *camera.RayFromImg(pixel + Eigen::Vector2d(kSide, 0)) - ray;
      const Eigen::Vector3d down = *camera.RayFromImg(pixel + Eigen::Vector2d(0, kSide)) - ray;
      const double expected = std::sqrt(right.cross(down).norm()) / kSide;
      EXPECT_NEAR(camera.RadiansPerPx(x), expected, 1e-3 * expected)
          << CameraModelName(camera.model) << " " << x.transpose();
    }
  }
}

TEST(Camera, FisheyeProjectionByHand) {
  Camera camera = Camera::FromFocal(1, CameraModel::kOpenCVFisheye, 100, 1000, 800);
  camera.params = {100, 200, 500, 400, 0.1, 0.01, 0.001, 0.0001};
  const double a = 0.5 * std::numbers::pi, a2 = a * a;  // straight to the right
  const double r = a * (1 + a2 * (0.1 + a2 * (0.01 + a2 * (0.001 + a2 * 0.0001))));
  EXPECT_LT((*camera.ImgFromRay({3, 0, 0}) - Eigen::Vector2d(500 + 100 * r, 400)).norm(), 1e-10);
  EXPECT_LT((*camera.ImgFromRay({0, 3, 0}) - Eigen::Vector2d(500, 400 + 200 * r)).norm(), 1e-10);
  EXPECT_FALSE(camera.ImgFromRay({0, 0, -1}).has_value());
  EXPECT_FALSE(camera.ImgFromRay({0, 0, 0}).has_value());

  Camera fov = Camera::FromFocal(1, CameraModel::kFov, 100, 1000, 800);
  fov.params[4] = 0.8;
  const double expected = std::atan(2 * std::tan(0.4) * 0.75) / 0.8;
  EXPECT_LT((*fov.ImgFromRay({1.5, 0, 2}) - Eigen::Vector2d(500 + 100 * expected, 400)).norm(),
            1e-10);

  Camera eucm = Camera::FromFocal(1, CameraModel::kEucm, 100, 1000, 800);
  eucm.params[4] = 0.5;  // with beta 1 the unified model of a parabolic mirror
  EXPECT_LT((*eucm.ImgFromRay({3, 0, 4}) - Eigen::Vector2d(500 + 100 * 2.0 / 3.0, 400)).norm(),
            1e-10);

  Camera division = Camera::FromFocal(1, CameraModel::kSimpleDivision, 100, 1000, 800);
  division.params[3] = -0.25;  // the ray of radius 1 is (1, 0.75)
  EXPECT_LT((*division.ImgFromRay({4, 0, 3}) - Eigen::Vector2d(600, 400)).norm(), 1e-10);
}

// The models of many coefficients, written out as their documentation has them.
TEST(Camera, DistortionByHand) {
  const double u = 0.3, v = -0.4, r2 = 0.25, r4 = r2 * r2, r6 = r4 * r2;
  Camera camera = Camera::FromFocal(1, CameraModel::kFullOpenCV, 100, 1000, 800);
  camera.params = {100, 200, 500, 400, 0.1, 0.2, 0.01, 0.02, 0.3, 0.4, 0.5, 0.6};
  const double radial = (1 + 0.1 * r2 + 0.2 * r4 + 0.3 * r6) / (1 + 0.4 * r2 + 0.5 * r4 + 0.6 * r6);
  Eigen::Vector2d d(u * radial + 2 * 0.01 * u * v + 0.02 * (r2 + 2 * u * u),
                    v * radial + 0.01 * (r2 + 2 * v * v) + 2 * 0.02 * u * v);
  EXPECT_LT(
      (camera.ImgFromCam({u, v}) - Eigen::Vector2d(500 + 100 * d[0], 400 + 200 * d[1])).norm(),
      1e-10);

  // Fisheyes: (u, v) is the angle 0.5 in its direction.
  const Eigen::Vector3d ray(0.6 * std::sin(0.5), -0.8 * std::sin(0.5), std::cos(0.5));
  camera.model = CameraModel::kThinPrismFisheye;
  camera.params = {100, 200, 500, 400, 0.1, 0.2, 0.01, 0.02, 0.3, 0.4, 0.05, 0.06};
  const double prism_radial = 1 + 0.1 * r2 + 0.2 * r4 + 0.3 * r6 + 0.4 * r4 * r4;
  d = {u * prism_radial + 2 * 0.01 * u * v + 0.02 * (r2 + 2 * u * u) + 0.05 * r2,
       v * prism_radial + 0.01 * (r2 + 2 * v * v) + 2 * 0.02 * u * v + 0.06 * r2};
  EXPECT_LT((*camera.ImgFromRay(ray) - Eigen::Vector2d(500 + 100 * d[0], 400 + 200 * d[1])).norm(),
            1e-10);

  camera.model = CameraModel::kRadTanThinPrismFisheye;
  camera.params = {100, 200, 500,  400,  0.1,  0.2,  0.3,  0.4,
                   0.5, 0.6, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06};
  const double factor =
      1 + 0.1 * r2 + 0.2 * r4 + 0.3 * r6 + 0.4 * r4 * r4 + 0.5 * r4 * r6 + 0.6 * r6 * r6;
  const double x = factor * u, y = factor * v, s2 = x * x + y * y;
  d = {x + 2 * 0.02 * x * y + 0.01 * (s2 + 2 * x * x) + 0.03 * s2 + 0.04 * s2 * s2,
       y + 2 * 0.01 * x * y + 0.02 * (s2 + 2 * y * y) + 0.05 * s2 + 0.06 * s2 * s2};
  EXPECT_LT((*camera.ImgFromRay(ray) - Eigen::Vector2d(500 + 100 * d[0], 400 + 200 * d[1])).norm(),
            1e-10);
}

// theta (1 - 0.2 theta^2) grows up to theta = 1.291 (0.8607 distorted).
TEST(Camera, FisheyePixelsBeyondTheFoldHaveNoRay) {
  Camera camera = Camera::FromFocal(1, CameraModel::kSimpleRadialFisheye, 500, 1000, 1000);
  camera.params[3] = -0.2;
  Camera prism = Camera::FromFocal(1, CameraModel::kThinPrismFisheye, 500, 1000, 1000);
  prism.params[4] = -0.2;
  for (double radius = 0.0; radius < 10.0; radius += 0.01) {
    for (const double angle : {0.0, 0.3, 2.0, 4.0}) {
      const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
      for (const Camera* c : {&camera, &prism}) {
        const auto ray = c->RayFromImg(c->PrincipalPoint() + 500 * radius * direction);
        if (radius < 0.86) {
          ASSERT_TRUE(ray.has_value()) << radius;
          EXPECT_GT(ray->z(), std::cos(1.292));
        } else if (radius > 0.861) {
          EXPECT_FALSE(ray.has_value()) << radius << " gave " << ray->transpose();
        }
      }
    }
  }
  // No fisheye shows more than all directions; a division model with k > 0 turns at 1 / sqrt(k).
  const Camera full = Camera::FromFocal(1, CameraModel::kSimpleFisheye, 500, 1000, 1000);
  EXPECT_TRUE(full.RayFromImg({500 + 500 * 3.14, 500}).has_value());
  EXPECT_FALSE(full.RayFromImg({500 + 500 * 3.15, 500}).has_value());
  Camera division = Camera::FromFocal(1, CameraModel::kSimpleDivision, 500, 1000, 1000);
  division.params[3] = 0.25;
  EXPECT_TRUE(division.RayFromImg({500 + 500 * 1.99, 500}).has_value());
  EXPECT_FALSE(division.RayFromImg({500 + 500 * 2.01, 500}).has_value());
}

TEST(Camera, PlanarModelsSeeNothingBehindThem) {
  for (const Camera& camera : AllCameras()) {
    EXPECT_EQ(camera.ImgFromRay({0.5, 0.2, -0.1}).has_value(),
              !camera.IsPlanar() && camera.model != CameraModel::kDivision)
        << CameraModelName(camera.model);
  }
}

TEST(Camera, CamFromImgInvertsUpToTheCornersAndBeyond) {
  for (const Camera& camera : AllCameras()) {
    if (!camera.IsPlanar()) continue;
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

TEST(Camera, OfNoModelIsNone) {
  Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, 500, 640, 480);
  camera.model = static_cast<CameraModel>(99);
  EXPECT_EQ(camera.Validate(), "the model is none that is known");
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
