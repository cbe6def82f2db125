#include "robust/fundamental_refinement.h"

#include <Eigen/LU>

#include "cairn/geometry/epipolar.h"
#include "cairn/math/decompositions.h"
#include "math/random_vectors.h"
#include "support/random_two_view.h"
#include "support/test.h"

namespace cairn {
namespace {

PointPairs MakePoints(const TwoViewScene& scene, double noise_px, int num_outliers, Rng& rng) {
  PointPairs points;
  points.Reset(static_cast<int>(scene.patches.size()), 900.0, 1300.0);
  auto noise = [&](double focal) -> Eigen::Vector2d {
    return noise_px / focal * GaussianVector<2>(rng);
  };
  for (int i = 0; i < points.size(); ++i) {
    PointCorrespondence p = scene.patches[i].points();
    if (i < num_outliers) p.x2 = {rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5)};
    p.x2 += noise(1300.0);
    p.x1 += noise(900.0);
    points.Set(i, p.x1, p.x2);
  }
  return points;
}

Eigen::Matrix3d Disturbed(const Eigen::Matrix3d& F, double by, Rng& rng) {
  Eigen::Matrix3d noise;
  for (int i = 0; i < 9; ++i) noise(i) = rng.Gaussian();
  return F.normalized() + by * noise.normalized();
}

TEST(RefineFundamentalMatrix, RecoversTheTruthFromARoughStart) {
  Rng rng(1);
  int num_found = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const TwoViewScene scene = RandomScene(rng, 100);
    const PointPairs points = MakePoints(scene, 0.0, 0, rng);
    // At other focal lengths it is no essential matrix.
    const Eigen::Matrix3d F = EssentialFromPose(scene.cam2_from_cam1);
    const Eigen::Matrix3d refined =
        RefineFundamentalMatrix(points, Disturbed(F, 0.05, rng),
                                {.scale_px = 20.0, .max_iterations = 100})
            .F();
    num_found += HomogeneousError(refined, F) < 1e-4;
    EXPECT_LT(SingularValues(refined).s[2], 1e-12);
    EXPECT_NEAR(refined.norm(), 1.0, 1e-12);
  }
  EXPECT_GE(num_found, 185);
}

TEST(RefineFundamentalMatrix, EndsWhereNoSmallChangeOfFGains) {
  Rng rng(2);
  for (int trial = 0; trial < 20; ++trial) {
    const TwoViewScene scene = RandomScene(rng, 150);
    const PointPairs points = MakePoints(scene, 0.5, 40, rng);
    const Eigen::Matrix3d E = EssentialFromPose(scene.cam2_from_cam1);
    FundamentalRefinementOptions options{.scale_px = 1.5, .max_iterations = 100};
    options.min_relative_gain = 1e-9;
    const auto cost_of = [&](const Eigen::Matrix3d& F) {
      return LinearizeFundamental(points, F, options.scale_px).cost;
    };
    const Eigen::Matrix3d refined = RefineFundamentalMatrix(points, E, options).F();
    const double cost = cost_of(refined);
    EXPECT_LT(cost, cost_of(E));
    options.max_iterations = 0;
    for (int k = 0; k < 20; ++k) {
      // The nearest of rank 2.
      const Eigen::Matrix3d near =
          RefineFundamentalMatrix(points, Disturbed(refined, 1e-4, rng), options).F();
      EXPECT_GT(cost_of(near), cost);
    }
  }
}

TEST(RefineFundamentalMatrix, SwappedImagesTransposeIt) {
  Rng rng(3);
  const TwoViewScene scene = RandomScene(rng, 100);
  const PointPairs points = MakePoints(scene, 0.5, 20, rng);
  PointPairs swapped;
  swapped.Reset(points.size(), points.focal2_px(), points.focal1_px());
  for (int i = 0; i < points.size(); ++i) swapped.Set(i, points.Point2(i), points.Point1(i));
  const Eigen::Matrix3d E = EssentialFromPose(scene.cam2_from_cam1);
  FundamentalRefinementOptions options{.scale_px = 1.5, .max_iterations = 100};
  options.min_relative_gain = 1e-10;
  const auto there = RefineFundamentalMatrix(points, E, options);
  const auto back = RefineFundamentalMatrix(swapped, E.transpose(), options);
  EXPECT_LT(HomogeneousError(there.F(), back.F().transpose()), 1e-5);
}

}  // namespace
}  // namespace cairn
