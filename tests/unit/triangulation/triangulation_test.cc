#include "cairn/triangulation/triangulation.h"

#include <Eigen/Geometry>

#include "cairn/base/rng.h"
#include "cairn/camera/camera.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/poses.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

Eigen::Vector3d RandomVector(Rng& rng, double size) {
  return size * UniformVector({{-1, 1}, {-1, 1}, {-1, 1}}, rng);
}

// A camera near `center` that looks at the origin from about ten units away.
TriangulationView RandomView(Rng& rng) {
  TriangulationView view;
  const Eigen::Vector3d center = Eigen::Vector3d(0, 0, -10) + RandomVector(rng, 4);
  const Eigen::Quaterniond look = LookAt(center, Eigen::Vector3d::Zero()).rotation;
  view.cam_from_world_rotation = (ExpSO3(RandomVector(rng, 0.2)) * look).toRotationMatrix();
  view.cam_from_world_translation = view.cam_from_world_rotation * -center;
  view.focal_px = rng.Uniform(500, 1500);
  return view;
}

void Observe(const Eigen::Vector3d& xyz, const Eigen::Vector2d& noise_px, TriangulationView& view) {
  const Eigen::Vector3d x = view.cam_from_world_rotation * xyz + view.cam_from_world_translation;
  view.ray = x.hnormalized() + noise_px / view.focal_px;
}

std::vector<TriangulationView> RandomViews(Rng& rng, int n, const Eigen::Vector3d& xyz,
                                           double noise_px) {
  std::vector<TriangulationView> views;
  for (int i = 0; i < n; ++i) {
    views.push_back(RandomView(rng));
    Observe(xyz, noise_px * GaussianVector<2>(rng), views.back());
  }
  return views;
}

// What is 6 px in a photograph that was reduced to half its size for features is 3 px there.
TEST(Triangulate, ErrorsOfLargePhotographsMayBeLarger) {
  Rng rng(3);
  const Eigen::Vector3d xyz(0.1, -0.2, 0.3);
  auto views = RandomViews(rng, 6, xyz, 0);
  Observe(xyz, {6, 0}, views[0]);
  EXPECT_EQ(Triangulate(views, {}).inliers.size(), 5u);
  for (TriangulationView& view : views) view.error_scale = 2;
  EXPECT_EQ(Triangulate(views, {}).inliers.size(), 6u);
  EXPECT_EQ(Camera::FromFocal(1, CameraModel::kPinhole, 5000, 6400, 4800).ErrorScale(), 2);
  EXPECT_EQ(Camera::FromFocal(1, CameraModel::kPinhole, 500, 640, 480).ErrorScale(), 1);
}

TEST(Triangulate, IsExactWithoutNoise) {
  Rng rng(1);
  int num_small_angles = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const Eigen::Vector3d xyz = RandomVector(rng, 2);
    const auto views = RandomViews(rng, 2 + static_cast<int>(rng.UniformInt(6)), xyz, 0);
    TriangulationOptions options;
    options.min_angle_deg = 0.5;
    const TriangulationResult result = Triangulate(views, options);
    if (result.status == TriangulationStatus::kSmallAngle) {
      ++num_small_angles;
      continue;
    }
    ASSERT_EQ(result.status, TriangulationStatus::kSuccess);
    ASSERT_LT((result.xyz - xyz).norm(), 1e-8);
    EXPECT_EQ(result.inliers.size(), views.size());
    EXPECT_LT(result.mean_error_px, 1e-6);
  }
  EXPECT_LT(num_small_angles, 50);
}

TEST(Triangulate, MidpointIsExactWithoutNoise) {
  Rng rng(2);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Vector3d xyz = RandomVector(rng, 2);
    const auto views = RandomViews(rng, 4, xyz, 0);
    const TriangulationResult result =
        Triangulate(views, {.min_angle_deg = 0, .max_refinements = 0});
    ASSERT_EQ(result.status, TriangulationStatus::kSuccess);
    EXPECT_LT((result.xyz - xyz).norm(), 1e-8);
  }
}

TEST(Triangulate, MovesWithTheWorld) {
  Rng rng(3);
  const Eigen::Vector3d xyz = RandomVector(rng, 2);
  auto views = RandomViews(rng, 5, xyz, 1.0);
  const TriangulationResult before = Triangulate(views, {});
  const Eigen::Matrix3d R = ExpSO3(RandomVector(rng, 2)).toRotationMatrix();
  const Eigen::Vector3d t = RandomVector(rng, 10);
  for (TriangulationView& view : views) {
    view.cam_from_world_rotation = view.cam_from_world_rotation * R.transpose();
    view.cam_from_world_translation -= view.cam_from_world_rotation * t;
  }
  const TriangulationResult after = Triangulate(views, {});
  EXPECT_LT((after.xyz - (R * before.xyz + t)).norm(), 1e-8);
}

// Refinement reaches the least reprojection error: no neighbor is better, and it beats the
// midpoint.
TEST(Triangulate, MinimizesTheReprojectionError) {
  Rng rng(4);
  const auto cost = [](const std::vector<TriangulationView>& views, const Eigen::Vector3d& xyz) {
    double sum = 0;
    for (const TriangulationView& view : views) {
      const Eigen::Vector3d x =
          view.cam_from_world_rotation * xyz + view.cam_from_world_translation;
      sum += (view.focal_px * (x.hnormalized() - view.ray)).squaredNorm();
    }
    return sum;
  };
  TriangulationOptions options;
  options.max_error_px = 100;
  options.max_refinements = 20;
  TriangulationOptions unrefined = options;
  unrefined.max_refinements = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const auto views = RandomViews(rng, 4, RandomVector(rng, 2), 2.0);
    const Eigen::Vector3d xyz = Triangulate(views, options).xyz;
    const double best = cost(views, xyz);
    EXPECT_LE(best, cost(views, Triangulate(views, unrefined).xyz));
    for (int k = 0; k < 6; ++k) {
      const Eigen::Vector3d step = (k < 3 ? 1e-3 : -1e-3) * Eigen::Vector3d::Unit(k % 3);
      EXPECT_LT(best, cost(views, xyz + step));
    }
  }
}

TEST(Triangulate, FindsThePointAmongWrongObservations) {
  Rng rng(5);
  int num_found = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d xyz = RandomVector(rng, 2);
    auto views = RandomViews(rng, 7, xyz, 0.5);
    for (const int i : {0, 3, 4}) views[i].ray += Eigen::Vector2d(0.3, 0.2 * (i - 2));
    const TriangulationResult result = Triangulate(views, {});
    if (result.status != TriangulationStatus::kSuccess) continue;
    num_found += (result.xyz - xyz).norm() < 0.1 && result.inliers == std::vector<int>{1, 2, 5, 6};
  }
  EXPECT_GE(num_found, 190);
}

TEST(Triangulate, WithoutPairsOneWrongObservationSpoilsThePoint) {
  Rng rng(6);
  const Eigen::Vector3d xyz = RandomVector(rng, 2);
  auto views = RandomViews(rng, 4, xyz, 0);
  views[0].ray += Eigen::Vector2d(0.5, 0.5);
  TriangulationOptions options;
  EXPECT_THAT(Triangulate(views, options).inliers, ElementsAre(1, 2, 3));
  options.max_pairs = 0;
  EXPECT_NE(Triangulate(views, options).status, TriangulationStatus::kSuccess);
}

TEST(Triangulate, ThresholdsDecide) {
  Rng rng(7);
  const Eigen::Vector3d xyz = RandomVector(rng, 1);
  auto views = RandomViews(rng, 3, xyz, 0);
  views[1].ray.x() += 6.0 / views[1].focal_px;
  TriangulationOptions options;
  options.min_views = 3;
  options.max_error_px = 1;
  EXPECT_EQ(Triangulate(views, options).status, TriangulationStatus::kTooFewViews);
  options.max_error_px = 12;
  const TriangulationResult result = Triangulate(views, options);
  ASSERT_EQ(result.status, TriangulationStatus::kSuccess);
  std::vector<Eigen::Vector3d> centers;
  for (const int i : result.inliers)
    centers.push_back(-views[i].cam_from_world_rotation.transpose() *
                      views[i].cam_from_world_translation);
  options.min_angle_deg = MaxTriangulationAngleDeg(result.xyz, centers) + 0.1;
  EXPECT_EQ(Triangulate(views, options).status, TriangulationStatus::kSmallAngle);
  options.min_views = 4;
  EXPECT_EQ(Triangulate(views, options).status, TriangulationStatus::kTooFewViews);
}

TEST(Triangulate, RejectsPointsBehindTheCameras) {
  Rng rng(8);
  auto views = RandomViews(rng, 3, Eigen::Vector3d(0, 0, -30), 0);  // behind all of them
  EXPECT_EQ(Triangulate(views, {}).status, TriangulationStatus::kTooFewViews);
}

TEST(Triangulate, RejectsParallelRaysAndTooFewViews) {
  TriangulationView a;
  TriangulationView b;
  b.cam_from_world_translation = Eigen::Vector3d(-1, 0, 0);
  EXPECT_EQ(Triangulate(std::vector{a, b}, {}).status, TriangulationStatus::kIllPosed);
  EXPECT_EQ(Triangulate(std::vector{a, a}, {}).status, TriangulationStatus::kIllPosed);
  EXPECT_EQ(Triangulate(std::vector{a}, {}).status, TriangulationStatus::kTooFewViews);
  EXPECT_EQ(Triangulate({}, {}).status, TriangulationStatus::kTooFewViews);
}

TEST(MaxTriangulationAngle, IsTheLargestAngleAtThePoint) {
  const std::vector<Eigen::Vector3d> centers = {{1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  EXPECT_NEAR(MaxTriangulationAngleDeg(Eigen::Vector3d::Zero(), centers), 90.0, 1e-9);
  EXPECT_EQ(MaxTriangulationAngleDeg(Eigen::Vector3d::Zero(), {}), 0.0);
}

TEST(MaxTriangulationAngle, OfManyCentersIsTheFirstOneThatIsEnough) {
  std::vector<Eigen::Vector3d> centers;
  for (int k = 0; k <= 90; ++k) {
    centers.emplace_back(std::cos(DegToRad(k)), std::sin(DegToRad(k)), 0);
  }
  EXPECT_NEAR(MaxTriangulationAngleDeg(Eigen::Vector3d::Zero(), centers, 19.5), 20.0, 1e-9);
  EXPECT_NEAR(MaxTriangulationAngleDeg(Eigen::Vector3d::Zero(), centers, 90.5), 90.0, 1e-9);
}

}  // namespace
}  // namespace cairn
