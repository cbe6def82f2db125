#include <Eigen/LU>
#include <cmath>
#include <numeric>
#include <vector>

#include "cairn/geometry/epipolar.h"
#include "math/random_vectors.h"
#include "robust/pose_refinement.h"
#include "robust/sampson_kernels.h"
#include "support/instruction_sets.h"
#include "support/random_two_view.h"
#include "support/test.h"

namespace cairn {
namespace {

// The scene's points with noise (pixels) in both images; the first `num_outliers` are random.
PointPairs MakePoints(const TwoViewScene& scene, double focal1, double focal2, double noise_px,
                      int num_outliers, Rng& rng) {
  PointPairs points;
  points.Reset(static_cast<int>(scene.patches.size()), focal1, focal2);
  for (int i = 0; i < points.size(); ++i) {
    PointCorrespondence p = scene.patches[i].points();
    if (i < num_outliers) p.x2 = {rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5)};
    p.x1 += noise_px / focal1 * GaussianVector<2>(rng);
    p.x2 += noise_px / focal2 * GaussianVector<2>(rng);
    points.Set(i, p.x1, p.x2);
  }
  return points;
}

// Sampson error in pixels, in double, through the fundamental matrix of focal-scaled points.
double Error(const PointPairs& points, const Eigen::Matrix3d& E, int i) {
  const Eigen::Vector3d scale1(points.focal1_px(), points.focal1_px(), 1.0);
  const Eigen::Vector3d scale2(points.focal2_px(), points.focal2_px(), 1.0);
  const Eigen::Matrix3d F =
      scale2.cwiseInverse().asDiagonal() * E * scale1.cwiseInverse().asDiagonal();
  return std::sqrt(SquaredSampsonError(F, points.focal1_px() * points.Point1(i),
                                       points.focal2_px() * points.Point2(i)));
}

TEST(SampsonKernels, AgreeWithTheDefinitionForEverySize) {
  Rng rng(1);
  const TwoViewScene scene = RandomScene(rng, 200);
  const Eigen::Matrix3d E = EssentialFromPose(scene.cam2_from_cam1);
  for (int n = 0; n <= 200; n += n < 40 ? 1 : 37) {
    TwoViewScene part = scene;
    part.patches.resize(n);
    const PointPairs points = MakePoints(part, 900.0, 1300.0, 1.0, n / 4, rng);
    std::vector<float> errors(points.num_blocks() * PointPairs::kBlock + 16);
    SampsonErrors(points, E, errors.data());
    double support = 0.0, soft = 0.0;
    for (int i = 0; i < n; ++i) {
      const double error = Error(points, E, i);
      EXPECT_NEAR(errors[i], error, 2e-3 + 1e-4 * error);
      support += std::max(0.0, 1.0 - error * error / 4.0);
      soft += 9.0 / (9.0 + error * error);
    }
    EXPECT_NEAR(ScoreSampson(points, E, 2.0), n == 0 ? -1.0 + 1.0 : support, 1e-3 * (1 + n));
    EXPECT_NEAR(SoftScoreSampson(points, E, 3.0), soft, 1e-3 * (1 + n));
  }
}

TEST(SampsonKernels, StopEarlyOnlyBelowTheBound) {
  Rng rng(2);
  const TwoViewScene scene = RandomScene(rng, 500);
  const PointPairs points = MakePoints(scene, 1000.0, 1000.0, 1.0, 250, rng);
  const Eigen::Matrix3d E = EssentialFromPose(scene.cam2_from_cam1);
  const double score = ScoreSampson(points, E, 2.0);
  EXPECT_GT(score, 100.0);
  EXPECT_EQ(ScoreSampson(points, E, 2.0, score - 0.5), score);
  EXPECT_EQ(ScoreSampson(points, E, 2.0, score + 0.5), -1.0);
  const Eigen::Matrix3d other = EssentialFromPose(RandomScene(rng, 1).cam2_from_cam1);
  EXPECT_EQ(ScoreSampson(points, other, 2.0, score), -1.0);
}

TEST(SampsonKernels, BothPointsAtTheirEpipolesAreNoError) {
  PointPairs points;
  points.Reset(1, 500.0, 500.0);
  points.Set(0, Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero());
  const Eigen::Matrix3d E =
      EssentialFromPose(Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 1)));
  EXPECT_EQ(ScoreSampson(points, E, 1.0), 1.0);
}

TEST(HomographyErrors, AgreeWithTheDefinition) {
  Rng rng(3);
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity() + 0.1 * Eigen::Matrix3d::Random();
  H(2, 0) = 0.3;
  PointPairs points;
  points.Reset(30, 800.0, 1100.0);
  for (int i = 0; i < 30; ++i) {
    const Eigen::Vector2d x1 = UniformVector({{-0.5, 0.5}, {-0.5, 0.5}}, rng);
    const Eigen::Vector2d x2 = (H * x1.homogeneous()).hnormalized();
    points.Set(i, x1, x2 + 1e-3 * GaussianVector<2>(rng));
  }
  std::vector<float> errors(32), flipped(32);
  HomographyErrors(points, H, errors.data());
  HomographyErrors(points, -3.0 * H, flipped.data());
  for (int i = 0; i < 30; ++i) {
    const double d2 =
        1100.0 * ((H * points.Point1(i).homogeneous()).hnormalized() - points.Point2(i)).norm();
    const double d1 =
        800.0 *
        ((H.inverse() * points.Point2(i).homogeneous()).hnormalized() - points.Point1(i)).norm();
    EXPECT_NEAR(errors[i], std::sqrt(0.5 * (d1 * d1 + d2 * d2)), 1e-2);
    EXPECT_NEAR(errors[i], flipped[i], 1e-3);
  }
  double support = 0.0;
  for (int i = 0; i < 30; ++i) support += std::max(0.0, 1.0 - errors[i] * errors[i] / 4.0);
  EXPECT_NEAR(ScoreHomography(points, -H, 2.0), support, 1e-2);
  EXPECT_EQ(ScoreHomography(points, Eigen::Matrix3d::Zero(), 2.0), 0.0);
  HomographyErrors(points, Eigen::Matrix3d::Zero(), errors.data());
  EXPECT_TRUE(std::isinf(errors[0]));
}

// Bearings all around two cameras, equidistant ones of 300 and 500 px a radian, with noise.
PointPairs MakeWidePoints(const Rigid3d& cam2_from_cam1, int n, double noise_px, Rng& rng) {
  PointPairs points;
  points.Reset(n, 300.0, 500.0, true);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d x1 = RandomOfLength(2, 8, rng);
    const Eigen::Vector3d x2 = cam2_from_cam1 * x1;
    const auto moved = [&](const Eigen::Vector3d& x, double focal) {
      return Eigen::Vector3d(x.normalized() + noise_px / focal * GaussianVector<3>(rng));
    };
    const Eigen::Vector3d moved2 = moved(x2, 500.0);
    points.SetRays(i, moved(x1, 300.0), 1.0 / 300.0, moved2, 1.0 / 500.0);
  }
  return points;
}

double WideError(const PointPairs& points, const Eigen::Matrix3d& E, int i) {
  const Eigen::Vector3d q1 = points.Ray1(i).normalized(), q2 = points.Ray2(i).normalized();
  return q2.dot(E * q1) / std::hypot((E * q1).norm() / 500.0, (E.transpose() * q2).norm() / 300.0);
}

TEST(WideSampsonKernels, AgreeWithTheDefinitionForEverySize) {
  Rng rng(11);
  const Rigid3d pose = RandomScene(rng, 1).cam2_from_cam1;
  const Eigen::Matrix3d E = EssentialFromPose(pose);
  for (int n = 0; n <= 200; n += n < 40 ? 1 : 37) {
    const PointPairs points = MakeWidePoints(pose, n, 1.0, rng);
    std::vector<float> errors(points.num_blocks() * PointPairs::kBlock + 16);
    SampsonErrors(points, E, errors.data());
    double support = 0.0, soft = 0.0;
    for (int i = 0; i < n; ++i) {
      const double error = WideError(points, E, i);
      EXPECT_NEAR(errors[i], std::abs(error), 2e-3 + 1e-4 * std::abs(error));
      support += std::max(0.0, 1.0 - error * error / 4.0);
      soft += 9.0 / (9.0 + error * error);
    }
    EXPECT_NEAR(ScoreSampson(points, E, 2.0), support, 1e-3 * (1 + n));
    EXPECT_NEAR(SoftScoreSampson(points, E, 3.0), soft, 1e-3 * (1 + n));
    EXPECT_EQ(ScoreSampson(points, E, 2.0, support + 1), -1.0);
  }
}

// On the plane, the same noise counted more the farther off axis; here it counts alike everywhere.
TEST(WideSampsonKernels, NoiseCountsAlikeInAllDirections) {
  Rng rng(12);
  const Rigid3d pose(ExpSO3(Eigen::Vector3d(0.2, -0.1, 0.3)), Eigen::Vector3d(1, 0.2, -0.1));
  const PointPairs points = MakeWidePoints(pose, 20000, 1.0, rng);
  std::vector<float> errors(points.num_blocks() * PointPairs::kBlock);
  SampsonErrors(points, EssentialFromPose(pose), errors.data());
  double sums[6] = {}, counts[6] = {};
  for (int i = 0; i < points.size(); ++i) {
    const int sector = static_cast<int>(std::acos(points.Ray1(i).normalized().z()) / M_PI * 5.999);
    sums[sector] += errors[i] * errors[i];
    ++counts[sector];
  }
  for (int k = 0; k < 6; ++k) {
    EXPECT_GT(counts[k], 500);
    EXPECT_NEAR(std::sqrt(sums[k] / counts[k]), 1.0, 0.06) << k;
  }
}

TEST(WideSampsonKernels, AgreeWithPlanarOnesNearTheAxis) {
  Rng rng(13);
  const Rigid3d pose(ExpSO3(Eigen::Vector3d(0.01, -0.02, 0.3)), Eigen::Vector3d(1, 0.2, -0.1));
  PointPairs planar, wide;
  planar.Reset(50, 700, 900);
  wide.Reset(50, 700, 900, true);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d x1 = UniformVector({{-0.3, 0.3}, {-0.3, 0.3}, {5, 9}}, rng);
    const Eigen::Vector3d x2 = pose * x1 + 0.01 * RandomDirection(rng);
    planar.Set(i, x1.hnormalized(), x2.hnormalized());
    wide.SetRays(i, x1, 1.0 / 700, x2, 1.0 / 900);
  }
  std::vector<float> planar_errors(64), wide_errors(64);
  SampsonErrors(planar, EssentialFromPose(pose), planar_errors.data());
  SampsonErrors(wide, EssentialFromPose(pose), wide_errors.data());
  const Eigen::Matrix3d H = pose.RotationMatrix();
  for (int i = 0; i < 50; ++i)
    EXPECT_NEAR(wide_errors[i], planar_errors[i], 0.05 * planar_errors[i]);
  HomographyErrors(planar, H, planar_errors.data());
  HomographyErrors(wide, -2.0 * H, wide_errors.data());
  for (int i = 0; i < 50; ++i)
    EXPECT_NEAR(wide_errors[i], planar_errors[i], 0.1 * planar_errors[i]);
}

TEST(WideHomographyErrors, AreAnglesOfRotationsAllAround) {
  Rng rng(14);
  const Eigen::Matrix3d R = ExpSO3(Eigen::Vector3d(0.4, -0.9, 1.3)).toRotationMatrix();
  PointPairs points;
  points.Reset(200, 300, 300, true);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d q = RandomDirection(rng);
    const Eigen::Vector3d axis = q.unitOrthogonal();
    points.SetRays(i, q, 1.0 / 300, R * (ExpSO3(axis * (0.01 + 0.001 * i)) * q), 1.0 / 300);
  }
  std::vector<float> errors(points.num_blocks() * PointPairs::kBlock);
  HomographyErrors(points, R, errors.data());
  for (int i = 0; i < 200; ++i) EXPECT_NEAR(errors[i], 300 * std::sin(0.01 + 0.001 * i), 0.05);
  EXPECT_NEAR(ScoreHomography(points, R, 3.1), 1 - std::pow(3.0 / 3.1, 2), 0.02);
  // Opposite directions are no match.
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d q = RandomDirection(rng);
    points.SetRays(i, q, 1.0 / 300, (i < 150 ? 1.0 : -1.0) * (R * q), 1.0 / 300);
  }
  HomographyErrors(points, R, errors.data());
  for (int i = 0; i < 200; ++i) EXPECT_EQ(errors[i] > 1e6, i >= 150);
}

TEST(WidePointPairs, HoldPixelsOfAnyCameraAndTheirSigns) {
  Camera fisheye = Camera::FromFocal(1, CameraModel::kSimpleFisheye, 300, 1200, 1200);
  const Camera pinhole = Camera::FromFocal(2, CameraModel::kPinhole, 800, 1200, 1000);
  PointPairs points;
  points.Reset(3, pinhole, pinhole);
  EXPECT_FALSE(points.is_wide());
  points.Reset(3, fisheye, pinhole);
  EXPECT_TRUE(points.is_wide());
  const Eigen::Vector2d behind(600 + 300 * 1.8, 600), pixel(500, 700);
  ASSERT_TRUE(points.SetPixels(0, fisheye, behind, pinhole, pixel));
  ASSERT_TRUE(points.SetPixels(1, fisheye, {600, 650}, pinhole, pixel));
  EXPECT_FALSE(points.SetPixels(2, fisheye, {600 + 300 * 3.2, 600}, pinhole, pixel));
  EXPECT_TRUE(points.IsBehind1(0));
  EXPECT_FALSE(points.IsBehind1(1));
  EXPECT_FALSE(points.IsBehind2(0));
  EXPECT_LT((points.Ray1(0).normalized() - *fisheye.RayFromImg(behind)).norm(), 1e-6);
  EXPECT_LT((points.Ray2(0).normalized() - *pinhole.RayFromImg(pixel)).norm(), 1e-6);
  PointPairs copy;
  const int32_t indices[] = {1, 0};
  copy.SetSubset(points, indices, 2);
  EXPECT_EQ(copy.Ray1(1), points.Ray1(0));
  EXPECT_TRUE(copy.is_wide());
  copy.SetShifted(points, 1);
  EXPECT_EQ(copy.Ray1(0), points.Ray1(0));
  EXPECT_EQ(copy.weight1()[0], points.weight1()[0]);
  EXPECT_EQ(copy.weight2()[0], points.weight2()[1]);
}

TEST(WidePointPairs, FocalLengthsAreTheUnitOfErrors) {
  const Camera fisheye = Camera::FromFocal(1, CameraModel::kSimpleFisheye, 300, 1200, 1200);
  const Camera pinhole = Camera::FromFocal(2, CameraModel::kPinhole, 800, 1200, 1000);
  Rng rng(3);
  const Eigen::Matrix3d E = EssentialFromPose(RandomScene(rng, 1).cam2_from_cam1);
  float errors[2][PointPairs::kBlock], transfers[2][PointPairs::kBlock];
  for (int k = 0; k < 2; ++k) {
    PointPairs points;
    points.Reset(1, (k + 1) * 300, (k + 1) * 800, true);
    ASSERT_TRUE(points.SetPixels(0, fisheye, {700, 600}, pinhole, {500, 700}));
    SampsonErrors(points, E, errors[k]);
    HomographyErrors(points, Eigen::Matrix3d::Identity(), transfers[k]);
  }
  EXPECT_NEAR(errors[1][0] / errors[0][0], 2, 1e-5);
  EXPECT_NEAR(transfers[1][0] / transfers[0][0], 2, 1e-5);
}

Eigen::Matrix<double, 3, 2> Tangent(const Eigen::Vector3d& t) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = t.cross(Eigen::Vector3d(0.3, 1.0, -0.2)).normalized();
  basis.col(1) = t.cross(basis.col(0));
  return basis;
}

class AccumulateSampsonTest : public testing::TestWithParam<bool> {};

// Gradient and hessian against central differences of the errors themselves.
TEST_P(AccumulateSampsonTest, AgreesWithCentralDifferences) {
  Rng rng(4);
  const TwoViewScene scene = RandomScene(rng, 45);
  const bool is_wide = GetParam();
  const PointPairs points = is_wide ? MakeWidePoints(scene.cam2_from_cam1, 45, 2.0, rng)
                                    : MakePoints(scene, 700.0, 900.0, 2.0, 5, rng);
  const Eigen::Quaterniond R = ExpSO3(0.01 * RandomDirection(rng)) * scene.cam2_from_cam1.rotation;
  const Eigen::Vector3d t = scene.cam2_from_cam1.translation.normalized();
  const auto B = Tangent(t);
  auto signed_error = [&](const Eigen::Matrix<double, 5, 1>& p, int i) {
    const Rigid3d pose(ExpSO3(p.head<3>()) * R, t + B * p.tail<2>());
    const Eigen::Matrix3d E = CrossMatrix(pose.translation) * pose.RotationMatrix();
    if (is_wide) return WideError(points, E, i);
    const double sign = points.Point2(i).homogeneous().dot(E * points.Point1(i).homogeneous());
    return std::copysign(Error(points, E, i), sign);
  };
  for (const RobustLoss loss : {RobustLoss::kTruncated, RobustLoss::kGemanMcClure}) {
    constexpr double kScale = 5.0, kStep = 1e-6;
    Eigen::Matrix<double, 5, 5> hessian = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> gradient = Eigen::Matrix<double, 5, 1>::Zero();
    double cost = 0.0;
    for (int i = 0; i < points.size(); ++i) {
      Eigen::Matrix<double, 5, 1> J, zero = Eigen::Matrix<double, 5, 1>::Zero();
      for (int k = 0; k < 5; ++k) {
        const Eigen::Matrix<double, 5, 1> h = kStep * Eigen::Matrix<double, 5, 1>::Unit(k);
        J[k] = (signed_error(h, i) - signed_error(-h, i)) / (2.0 * kStep);
      }
      const double e = signed_error(zero, i);
      const double s2 = kScale * kScale;
      double weight = e * e < s2 ? 1.0 : 0.0;
      double value = std::min(e * e / s2, 1.0);
      if (loss == RobustLoss::kGemanMcClure) {
        weight = std::pow(s2 / (s2 + e * e), 2);
        value = e * e / (s2 + e * e);
      }
      hessian += weight * J * J.transpose();
      gradient += weight * J * e;
      cost += value;
    }
    const NormalEquations<5> equations = AccumulateSampson(points, Rigid3d(R, t), B, loss, kScale);
    EXPECT_LT((equations.hessian - hessian).norm(), 1e-3 * hessian.norm());
    EXPECT_LT((equations.gradient - gradient).norm(), 1e-3 * gradient.norm() + 1.0);
    EXPECT_NEAR(equations.cost, cost, 1e-3 * cost);
    EXPECT_EQ(equations.cost, SampsonCost(points, Rigid3d(R, t), loss, kScale));
  }
}

INSTANTIATE_TEST_SUITE_P(PlanarAndWide, AccumulateSampsonTest, testing::Bool());

// The same bits with every instruction set of this machine.
TEST(SampsonKernels, DoNotDependOnTheInstructionSet) {
  Rng rng(5);
  const TwoViewScene scene = RandomScene(rng, 333);
  const PointPairs points = MakePoints(scene, 700.0, 900.0, 2.0, 100, rng);
  const Eigen::Matrix3d E = EssentialFromPose(scene.cam2_from_cam1);
  const Rigid3d pose(scene.cam2_from_cam1.rotation, scene.cam2_from_cam1.translation.normalized());
  struct Result {
    double score, soft, cost;
    Eigen::Matrix<double, 5, 5> hessian;
    std::vector<float> errors;
  };
  auto compute = [&] {
    Result result;
    result.score = ScoreSampson(points, E, 2.0);
    result.soft = SoftScoreSampson(points, E, 2.0);
    result.hessian =
        AccumulateSampson(points, pose, Tangent(pose.translation), RobustLoss::kGemanMcClure, 2.0)
            .hessian;
    result.cost = SampsonCost(points, pose, RobustLoss::kTruncated, 2.0);
    result.errors.resize(336);
    SampsonErrors(points, E, result.errors.data());
    return result;
  };
  const Result expected = compute();
  ForEachInstructionSet([&] {
    const Result result = compute();
    EXPECT_EQ(result.score, expected.score);
    EXPECT_EQ(result.soft, expected.soft);
    EXPECT_EQ(result.cost, expected.cost);
    EXPECT_EQ(result.hessian, expected.hessian);
    EXPECT_EQ(result.errors, expected.errors);
  });
}

TEST(RefinePose, RecoversTheTruthFromARoughStart) {
  Rng rng(6);
  int num_found = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const TwoViewScene scene = RandomScene(rng, 100);
    const PointPairs points = MakePoints(scene, 1000.0, 1000.0, 0.0, 0, rng);
    const Eigen::Vector3d translation =
        scene.cam2_from_cam1.translation.normalized() + 0.1 * RandomDirection(rng);
    const Rigid3d start(ExpSO3(0.05 * RandomDirection(rng)) * scene.cam2_from_cam1.rotation,
                        translation);
    PoseRefinementOptions options;
    options.loss = RobustLoss::kGemanMcClure;
    options.scale_px = 20.0;
    options.max_iterations = 50;
    num_found += PoseError(RefinePose(points, start, options), scene.cam2_from_cam1) < 1e-5;
  }
  EXPECT_GE(num_found, 190);
}

TEST(RefinePose, IgnoresOutliersBeyondItsScale) {
  Rng rng(7);
  const TwoViewScene scene = RandomScene(rng, 200);
  const PointPairs points = MakePoints(scene, 1000.0, 1000.0, 0.3, 60, rng);
  const Rigid3d pose = RefinePose(points, scene.cam2_from_cam1, {.scale_px = 2.0});
  EXPECT_LT(PoseError(pose, scene.cam2_from_cam1), 0.005);
  EXPECT_LE(SampsonCost(points, pose, RobustLoss::kTruncated, 2.0),
            SampsonCost(points, scene.cam2_from_cam1, RobustLoss::kTruncated, 2.0));
}

TEST(RefinePose, GroupsOfPointsAddUp) {
  Rng rng(3);
  const TwoViewScene scene = RandomScene(rng, 100);
  const PointPairs all = MakePoints(scene, 1000.0, 1000.0, 0.5, 0, rng);
  std::vector<int32_t> first(40), rest(60);
  std::iota(first.begin(), first.end(), 0);
  std::iota(rest.begin(), rest.end(), 40);
  PointPairs a, b;
  a.SetSubset(all, first.data(), 40);
  b.SetSubset(all, rest.data(), 60);
  const PoseRefinementOptions options{.loss = RobustLoss::kGemanMcClure};
  const Rigid3d whole = RefinePose(all, scene.cam2_from_cam1, options);
  const WeightedPoints groups[] = {{&a}, {&b}};
  const Rigid3d parts = RefinePose(groups, scene.cam2_from_cam1, options);
  EXPECT_TRUE(parts.translation.isApprox(whole.translation, 1e-4));
  // Without weight a group has no say.
  const WeightedPoints only_a[] = {{&a}, {&b, 1.0, 0.0}};
  const Rigid3d alone = RefinePose(a, scene.cam2_from_cam1, options);
  const Rigid3d ignoring = RefinePose(only_a, scene.cam2_from_cam1, options);
  EXPECT_TRUE(ignoring.translation.isApprox(alone.translation, 1e-6));
}

TEST(RefinePose, SwappedImagesInvertThePose) {
  Rng rng(8);
  const TwoViewScene scene = RandomScene(rng, 100);
  const PointPairs points = MakePoints(scene, 800.0, 1100.0, 0.5, 20, rng);
  PointPairs swapped;
  swapped.Reset(points.size(), 1100.0, 800.0);
  for (int i = 0; i < points.size(); ++i) swapped.Set(i, points.Point2(i), points.Point1(i));
  PoseRefinementOptions options;
  options.scale_px = 3.0;
  const Rigid3d there = RefinePose(points, scene.cam2_from_cam1, options);
  const Rigid3d back = RefinePose(swapped, Inverse(scene.cam2_from_cam1), options);
  EXPECT_LT(PoseError(Inverse(there), back), 1e-5);
}

TEST(PointPairs, SubsetsKeepOrderAndPadding) {
  Rng rng(9);
  const PointPairs points = MakePoints(RandomScene(rng, 40), 800.0, 1100.0, 0.0, 0, rng);
  const int32_t indices[3] = {17, 3, 39};
  PointPairs subset;
  subset.Reset(1000, 1.0, 1.0);
  subset.SetSubset(points, indices, 3);
  ASSERT_EQ(subset.size(), 3);
  EXPECT_EQ(subset.focal2_px(), 1100.0f);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(subset.Point2(i), points.Point2(indices[i]));
  EXPECT_EQ(subset.x1()[15], 0.0f);
  subset.SetPrefix(points, 20);
  ASSERT_EQ(subset.size(), 20);
  EXPECT_EQ(subset.Point1(19), points.Point1(19));
  EXPECT_EQ(subset.y2()[20], 0.0f);
  subset.SetShifted(points, 15);
  EXPECT_EQ(subset.Point1(3), points.Point1(3));
  EXPECT_EQ(subset.Point2(3), points.Point2(18));
  EXPECT_EQ(subset.Point2(30), points.Point2(5));
  subset.Truncate(7);
  EXPECT_EQ(subset.size(), 7);
  EXPECT_EQ(subset.x2()[7], 0.0f);
}

}  // namespace
}  // namespace cairn
