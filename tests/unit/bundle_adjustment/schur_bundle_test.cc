#include <functional>
#include <string>
#include <vector>

#include "math/random_vectors.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"
#include "unit/bundle_adjustment/perturbed.h"

// cairn's own bundle adjustment, which kAuto stands for.
namespace cairn {
namespace {

BundleAdjustmentOptions With(BundleSolver solver) {
  BundleAdjustmentOptions options = Precise();
  options.solver = solver;
  return options;
}

// Largest differences of the poses, of the intrinsics (relative) and of the points.
double LargestDifference(const Reconstruction& a, const Reconstruction& b) {
  double largest = 0;
  for (const auto& [id, image] : a.images) {
    const Rigid3d& other = b.images.at(id).cam_from_world;
    largest = std::max({largest, (image.cam_from_world.translation - other.translation).norm(),
                        image.cam_from_world.rotation.angularDistance(other.rotation)});
  }
  for (const auto& [id, camera] : a.cameras) {
    for (size_t k = 0; k < camera.params.size(); ++k) {
      const double value = b.cameras.at(id).params[k];
      largest = std::max(largest, std::abs(camera.params[k] - value) / (1 + std::abs(value)));
    }
  }
  for (const auto& [id, point] : a.points3D) {
    largest = std::max(largest, (point.xyz - b.points3D.at(id).xyz).norm());
  }
  return largest;
}

struct ScopeCase {
  std::string name;
  std::function<void(const Reconstruction&, BundleAdjustmentScope&)> change;
  CameraModel model = CameraModel::kSimpleRadial;
};

std::vector<ScopeCase> ScopeCases() {
  const auto everything = [](const Reconstruction& model, BundleAdjustmentScope& scope) {
    scope.focal_lengths = scope.distortions = scope.principal_points = true;
    for (const auto& [id, camera] : model.cameras) {
      scope.priors[id] = {camera.params, 0.1, 10};
      scope.priors[id].params[0] *= 1.05;
    }
  };
  return {{"poses and points", [](auto&, auto&) {}},
          {"intrinsics with priors", everything},
          {"intrinsics of many parameters", everything, CameraModel::kFullOpenCV},
          {"a constant camera",
           [&](const auto& model, auto& scope) {
             scope.focal_lengths = true;
             scope.fixed_cameras = {model.cameras.begin()->first};
           }},
          {"positions that are known, one wrong",
           [](const auto& model, auto& scope) {
             for (const auto& [id, image] : model.images) {
               scope.image_positions[id] = {image.cam_from_world.Center(), {10, 10, 10}};
             }
             scope.image_positions.at(2).position.x() += 5;
           }},
          {"surveyed points", [](const auto& model, auto& scope) {
             for (point3D_t id = 1; id <= 4; ++id) {
               const Point3D& point = model.points3D.at(id);
               SurveyedPoint surveyed{{point.xyz, {100, 100, 100}}, {}};
               for (const TrackElement& element : point.track) {
                 surveyed.pixels[element.image_id] =
                     model.images.at(element.image_id).points2D[element.point2D];
               }
               if (id == 1) surveyed.prior.position.x() += 0.5;
               scope.surveyed_points.push_back(surveyed);
             }
           }}};
}

void ExpectCeresEndsThere(const ScopeCase& of, SyntheticOptions scene, BundleSolver solver) {
  scene.model = of.model;
  const Reconstruction truth = MakeSyntheticScene(scene).truth;
  BundleAdjustmentScope scope;
  of.change(truth, scope);
  scope.fixed_images = {1, 6};  // the gauge
  const Reconstruction start = Perturbed(truth, {0.005, 0.02, 0.02});
  Reconstruction ours = start, theirs = start;
  for (const image_t id : scope.fixed_images) {
    ours.images.at(id).cam_from_world = theirs.images.at(id).cam_from_world =
        truth.images.at(id).cam_from_world;
  }
  const auto report = AdjustBundle(ours, scope, Precise(), kOneThread);
  const auto reference = AdjustBundle(theirs, scope, With(solver), kOneThread);
  EXPECT_EQ(report.status, BundleAdjustmentStatus::kConverged) << of.name;
  EXPECT_EQ(report.num_observations, reference.num_observations);
  EXPECT_NEAR(report.initial_rmse, reference.initial_rmse, 1e-9 * reference.initial_rmse);
  EXPECT_NEAR(report.final_rmse, reference.final_rmse, 1e-7) << of.name;
  EXPECT_LT(LargestDifference(ours, theirs), 1e-3) << of.name << scene.shared_camera;
}

constexpr SyntheticOptions kFewImages{
    .num_images = 12, .num_points = 300, .noise_px = 0.5, .outlier_share = 0.02};
// So many that pairs of images have no blocks (SchurFlops).
constexpr SyntheticOptions kManyThatSeeTheSame{.num_images = 502,
                                               .num_points = 60,
                                               .noise_px = 0.5,
                                               .outlier_share = 0.02,
                                               .visible_share = 0.3};

TEST(SchurBundle, EndsWhereCeresEnds) {
  for (const ScopeCase& of : ScopeCases()) {
    for (const bool shared : {true, false}) {
      SyntheticOptions scene = kFewImages;
      scene.shared_camera = shared;
      ExpectCeresEndsThere(of, scene, BundleSolver::kDenseSchur);
    }
  }
}

TEST(SchurBundle, EndsThereByWayOfThePoints) {
  ExpectCeresEndsThere(ScopeCases()[1], kManyThatSeeTheSame, BundleSolver::kIterativeSchur);
}

// As seen by lenses of a hundred times the focal length from a hundred times as far.
Reconstruction FromAfar(Reconstruction model) {
  for (auto& [id, camera] : model.cameras) camera.SetMeanFocal(100 * camera.MeanFocal());
  for (auto& [id, image] : model.images) {
    image.cam_from_world.translation *= 100;
    for (size_t k = 0; k < image.points2D.size(); ++k) {
      const auto point = model.points3D.find(image.point3D_ids[k]);
      if (point == model.points3D.end()) continue;
      const Eigen::Vector3d ray = image.cam_from_world * point->second.xyz;
      image.points2D[k] = *model.CameraOf(image).ImgFromRay(ray);
    }
  }
  return model;
}

// The valleys that lead to the minimum bend. Without acceleration: 180 steps; far off after 200.
TEST(SchurBundle, FollowsBentValleysOfLongLenses) {
  struct Case {
    SyntheticOptions scene;
    double turn;  // of each image about the scene, radians
    int max_iterations;
  };
  for (const Case& of : {Case{{.num_images = 10, .visible_share = 0.3}, 0.1, 100},
                         Case{{.num_images = 40, .visible_share = 0.15}, 0.3, 200}}) {
    const Reconstruction truth = FromAfar(MakeSyntheticScene(of.scene).truth);
    Reconstruction model = Perturbed(truth, {0, 1, 0.3});
    Rng rng(5);
    for (auto& [id, image] : model.images) {
      const Eigen::Vector3d axis = GaussianVector<3>(rng);
      image.cam_from_world.rotation = image.cam_from_world.rotation * ExpSO3(of.turn * axis);
    }
    BundleAdjustmentScope scope;
    scope.focal_lengths = true;
    for (const auto& [id, camera] : model.cameras) scope.priors[id] = {camera.params, 0.1, 0};
    BundleAdjustmentOptions options = Precise();
    options.max_iterations = of.max_iterations;
    const auto report = AdjustBundle(model, scope, options, kOneThread);
    EXPECT_EQ(report.status, BundleAdjustmentStatus::kConverged);
    EXPECT_LT(report.final_rmse, 1e-6);
    EXPECT_LT(CompareAligned(model, truth).angle, 1e-6);
  }
}

struct ThreadsCase {
  SyntheticOptions scene;
  bool points = true;  // without, Ceres adjusts
};

TEST(AdjustBundle, IsEqualForAnyNumberOfThreads) {
  const SyntheticOptions many_points{.num_images = 20, .num_points = 3000, .noise_px = 0.5};
  for (const auto& [scene, points] : {ThreadsCase{many_points}, ThreadsCase{many_points, false},
                                      ThreadsCase{kManyThatSeeTheSame}}) {
    const Reconstruction truth = MakeSyntheticScene(scene).truth;
    BundleAdjustmentScope scope;
    scope.focal_lengths = scope.distortions = true;
    scope.points = points;
    Reconstruction one = Perturbed(truth, {});
    const Reconstruction start = one;
    BundleAdjustmentOptions options = Precise();
    options.max_iterations = 5;
    AdjustBundle(one, scope, options, kOneThread);
    EXPECT_GT(LargestDifference(one, start), 0);
    for (const int num_threads : {2, 3, 8}) {
      Reconstruction model = start;
      AdjustBundle(model, scope, options, {.num_threads = num_threads});
      EXPECT_EQ(LargestDifference(one, model), 0);
    }
  }
}

}  // namespace
}  // namespace cairn
