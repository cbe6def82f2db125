#include "cairn/bundle_adjustment/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "support/synthetic_reconstruction.h"

namespace cairn {
namespace {

using testing_support::CompareAligned;
using testing_support::kOneThread;
using testing_support::MadeReconstruction;
using testing_support::MakeSyntheticScene;
using testing_support::PoseDifference;
using testing_support::SyntheticOptions;

BundleAdjustmentScope Scope(const std::function<void(BundleAdjustmentScope&)>& change) {
  BundleAdjustmentScope scope;
  change(scope);
  return scope;
}

BundleAdjustmentOptions Precise() {
  BundleAdjustmentOptions options;
  options.max_iterations = 200;
  options.function_tolerance = 1e-12;
  return options;
}

struct Perturbation {
  double rotation = 0.02;  // radians
  double position = 0.1;
  double point = 0.1;
  double focal = 0;  // relative
};

Reconstruction Perturbed(const Reconstruction& truth, const Perturbation& by) {
  Rng rng(7);
  const auto random = [&](double size) {
    return Eigen::Vector3d(size * Eigen::Vector3d(rng.Gaussian(), rng.Gaussian(), rng.Gaussian()));
  };
  Reconstruction model = truth;
  for (auto& [id, image] : model.images) {
    const Eigen::Vector3d center = image.cam_from_world.Center() + random(by.position);
    image.cam_from_world.rotation = ExpSO3(random(by.rotation)) * image.cam_from_world.rotation;
    image.cam_from_world.translation = image.cam_from_world.rotation * -center;
  }
  for (auto& [id, point] : model.points3D) point.xyz += random(by.point);
  for (auto& [id, camera] : model.cameras) {
    camera.SetMeanFocal(camera.MeanFocal() * (1 + by.focal * rng.Uniform(-1, 1)));
  }
  return model;
}

TEST(AdjustBundle, RecoversAnExactSceneWithEverySolver) {
  const MadeReconstruction scene = MakeSyntheticScene({});
  for (const auto& [solver, name] : kBundleSolvers) {
    BundleAdjustmentOptions options = Precise();
    options.solver = solver;
    Reconstruction model = Perturbed(scene.truth, {});
    const BundleAdjustmentReport report = AdjustBundle(model, {}, options, kOneThread);
    EXPECT_EQ(report.status, BundleAdjustmentStatus::kConverged) << name;
    EXPECT_GT(report.initial_rmse, 1.0);
    EXPECT_LT(report.final_rmse, 1e-6);
    EXPECT_EQ(report.num_images, 6);
    EXPECT_EQ(report.num_observations, model.NumObservations());
    const PoseDifference difference = CompareAligned(model, scene.truth);
    EXPECT_LT(difference.center, 1e-6) << name;
    EXPECT_LT(difference.angle, 1e-6) << name;
  }
}

TEST(AdjustBundle, AutoChoosesTheSolverByTheNumberOfImages) {
  const MadeReconstruction scene = MakeSyntheticScene({.num_points = 50});
  BundleAdjustmentOptions options = Precise();
  Reconstruction model = scene.truth;
  EXPECT_EQ(AdjustBundle(model, {}, options, kOneThread).solver, BundleSolver::kDenseSchur);
  options.max_dense_images = 5;
  EXPECT_EQ(AdjustBundle(model, {}, options, kOneThread).solver, BundleSolver::kSparseSchur);
  options.max_sparse_images = 5;
  EXPECT_EQ(AdjustBundle(model, {}, options, kOneThread).solver, BundleSolver::kIterativeSchur);
  // Of 40 images that all see the same points nothing is sparse.
  options = Precise();
  options.max_iterations = 0;
  options.max_dense_images = 10;
  model = MakeSyntheticScene({.num_images = 40, .num_points = 20}).truth;
  EXPECT_EQ(AdjustBundle(model, {}, options, kOneThread).solver, BundleSolver::kIterativeSchur);
  options.max_dense_images = 20;
  EXPECT_EQ(AdjustBundle(model, {}, options, kOneThread).solver, BundleSolver::kSparseSchur);
}

TEST(AdjustBundle, RefinesFocalLengthAndDistortionOfEveryModel) {
  for (const CameraModel model_kind :
       {CameraModel::kSimplePinhole, CameraModel::kPinhole, CameraModel::kSimpleRadial,
        CameraModel::kRadial, CameraModel::kOpenCV, CameraModel::kSimpleRadialFisheye,
        CameraModel::kSimpleDivision}) {
    for (const bool shared : {true, false}) {
      SyntheticOptions synthetic{.num_images = 8, .model = model_kind, .shared_camera = shared};
      const MadeReconstruction scene = MakeSyntheticScene(synthetic);
      Reconstruction model = Perturbed(scene.truth, {.focal = 0.05});
      for (auto& [id, camera] : model.cameras) {
        for (const int k : camera.DistortionIndices()) camera.params[k] = 0;
      }
      BundleAdjustmentScope scope;
      scope.focal_lengths = true;
      scope.distortions = true;
      const BundleAdjustmentReport report = AdjustBundle(model, scope, Precise(), kOneThread);
      EXPECT_LT(report.final_rmse, 1e-5) << CameraModelName(model_kind);
      for (const auto& [id, camera] : model.cameras) {
        const Camera& truth = scene.truth.cameras.at(id);
        for (size_t k = 0; k < camera.params.size(); ++k) {
          EXPECT_NEAR(camera.params[k], truth.params[k], 1e-4 * (1 + std::abs(truth.params[k])))
              << CameraModelName(model_kind) << " " << k;
        }
      }
      EXPECT_LT(CompareAligned(model, scene.truth).center, 1e-4);
    }
  }
}

BundleAdjustmentScope IntrinsicsScope(const Reconstruction& model, double focal_sigma) {
  BundleAdjustmentScope scope;
  scope.focal_lengths = true;
  scope.distortions = true;
  if (focal_sigma == 0) return scope;
  for (const auto& [id, camera] : model.cameras) {
    scope.priors[id] = {.params = camera.params, .focal_sigma = focal_sigma};
  }
  return scope;
}

// Image 3 sees 20 points on a plane that faces it, and nothing else: its focal length and its
// distance from them say the same.
Reconstruction SceneWithAPlaneInImage3(uint64_t seed) {
  constexpr double kNoisePx = 0.5;
  Reconstruction model = MakeSyntheticScene({.noise_px = kNoisePx,
                                             .model = CameraModel::kSimpleRadial,
                                             .shared_camera = false,
                                             .seed = seed})
                             .truth;
  model.cameras.at(3).params.back() = 0;
  Rng rng(seed);
  const std::vector<point3D_t> seen = model.images.at(3).point3D_ids;
  for (size_t k = 0; k < seen.size(); ++k) {
    const Track track = model.points3D.at(seen[k]).track;
    const auto in3 = std::find_if(track.begin(), track.end(),
                                  [](const TrackElement& e) { return e.image_id == 3; });
    if (k >= 20) {
      model.RemoveObservation(seen[k], *in3);
      continue;
    }
    Eigen::Vector3d& xyz = model.points3D.at(seen[k]).xyz;
    const Rigid3d cam3_from_world = model.images.at(3).cam_from_world;
    const Eigen::Vector3d x = cam3_from_world * xyz;
    xyz = Inverse(cam3_from_world) * Eigen::Vector3d(8 / x.z() * x);
    for (const TrackElement& element : track) {
      RegisteredImage& image = model.images.at(element.image_id);
      image.points2D[element.point2D] =
          model.CameraOf(image).ImgFromCam((image.cam_from_world * xyz).hnormalized()) +
          kNoisePx * Eigen::Vector2d(rng.Gaussian(), rng.Gaussian());
    }
  }
  return model;
}

TEST(AdjustBundle, APriorHoldsACameraThatItsPointsDoNotDetermine) {
  double without_prior = 0;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const Reconstruction start = SceneWithAPlaneInImage3(seed);
    const auto focal_change = [&](double focal_sigma) {
      Reconstruction model = start;
      AdjustBundle(model, IntrinsicsScope(start, focal_sigma), Precise(), kOneThread);
      const Camera& camera = model.cameras.at(3);
      // Where the image's corner goes, relative to its radius.
      const double r = 0.5 * camera.DiagonalPx() / camera.MeanFocal();
      if (focal_sigma > 0) {
        EXPECT_LT(std::abs(camera.params.back()) * r * r, 0.05);
      }
      return std::abs(std::log(camera.MeanFocal() / start.cameras.at(3).MeanFocal()));
    };
    // Of EXIF, and of a guess.
    for (const double sigma : {0.1, 0.7}) EXPECT_LT(focal_change(sigma), 0.5 * sigma);
    without_prior = std::max(without_prior, focal_change(0));
  }
  EXPECT_GT(without_prior, 1.0);
}

// Also where bundle adjustment begins elsewhere.
TEST(AdjustBundle, APriorPullsTowardsItsFocalLength) {
  const Reconstruction start = SceneWithAPlaneInImage3(1);
  for (const double factor : {0.9, 1.2}) {
    Reconstruction model = start;
    BundleAdjustmentScope scope = IntrinsicsScope(start, 0.001);
    for (const int k : start.cameras.at(3).FocalIndices()) scope.priors.at(3).params[k] *= factor;
    AdjustBundle(model, scope, Precise(), kOneThread);
    const double change = model.cameras.at(3).MeanFocal() / start.cameras.at(3).MeanFocal();
    EXPECT_NEAR(change, factor, 0.02);
  }
}

TEST(AdjustBundle, APriorDoesNotMoveACameraThatItsPointsDetermine) {
  constexpr int kNumScenes = 5;
  double squared_error[2] = {}, shift[2] = {};  // of log focal length and distortion
  for (uint64_t seed = 0; seed < kNumScenes; ++seed) {
    const Reconstruction truth =
        MakeSyntheticScene(
            {.num_points = 1000, .noise_px = 1, .model = CameraModel::kSimpleRadial, .seed = seed})
            .truth;
    const auto adjust = [&](double focal_sigma) {
      Reconstruction model = truth;
      BundleAdjustmentScope scope = IntrinsicsScope(truth, focal_sigma);
      // A focal length that is one standard deviation off, and no distortion.
      if (focal_sigma > 0) scope.priors[1].params = {850 * std::exp(focal_sigma), 500, 400, 0};
      BundleAdjustmentOptions options = Precise();
      options.function_tolerance = 1e-9;
      AdjustBundle(model, scope, options, kOneThread);
      const std::vector<double>& params = model.cameras.at(1).params;
      return std::array<double, 2>{std::log(params[0] / 850), params[3]};
    };
    const std::array<double, 2> with = adjust(0.1), without = adjust(0);
    const double expected[2] = {0, truth.cameras.at(1).params[3]};
    for (int i = 0; i < 2; ++i) {
      squared_error[i] += std::pow(without[i] - expected[i], 2) / kNumScenes;
      shift[i] = std::max(shift[i], std::abs(with[i] - without[i]));
    }
  }
  for (int i = 0; i < 2; ++i) EXPECT_LT(shift[i], 0.1 * std::sqrt(squared_error[i])) << i;
}

TEST(AdjustBundle, RefinesPrincipalPointsAsFarAsTheirPriorLets) {
  const Reconstruction truth =
      MakeSyntheticScene({.num_points = 500, .model = CameraModel::kSimpleRadial}).truth;
  const Eigen::Vector2d shift(8, -6);
  Reconstruction start = truth;
  start.cameras.at(1).params[1] += shift.x();
  start.cameras.at(1).params[2] += shift.y();
  const auto error_px = [&](bool principal_points, double sigma_px) {
    BundleAdjustmentScope scope = IntrinsicsScope(start, sigma_px > 0 ? 0.5 : 0);
    scope.principal_points = principal_points;
    if (sigma_px > 0) scope.priors.at(1).principal_point_sigma_px = sigma_px;
    Reconstruction model = start;
    AdjustBundle(model, scope, Precise(), kOneThread);
    const std::vector<double>& params = model.cameras.at(1).params;
    const std::vector<double>& expected = truth.cameras.at(1).params;
    return std::hypot(params[1] - expected[1], params[2] - expected[2]);
  };
  EXPECT_LT(error_px(true, 1000), 0.01);
  EXPECT_LT(error_px(true, 10), 2);
  EXPECT_GT(error_px(true, 0.01), 9);
  // Without a prior, or where they are not asked for, they stay.
  EXPECT_EQ(error_px(true, 0), shift.norm());
  EXPECT_EQ(error_px(false, 10), shift.norm());
}

TEST(AdjustBundle, HoldsWhatIsOutOfScope) {
  const MadeReconstruction scene =
      MakeSyntheticScene({.model = CameraModel::kRadial, .shared_camera = false});
  const Reconstruction start = Perturbed(scene.truth, {.focal = 0.02});
  const auto adjust = [&](const BundleAdjustmentScope& scope) {
    Reconstruction model = start;
    BundleAdjustmentOptions options = Precise();
    options.max_iterations = 3;
    EXPECT_NE(AdjustBundle(model, scope, options, kOneThread).status,
              BundleAdjustmentStatus::kFailed);
    return model;
  };
  {
    const Reconstruction model = adjust(Scope([](auto& s) { s.rotations = false; }));
    for (const auto& [id, image] : start.images) {
      EXPECT_EQ(model.images.at(id).cam_from_world.rotation.coeffs(),
                image.cam_from_world.rotation.coeffs());
      EXPECT_NE(model.images.at(id).cam_from_world.translation, image.cam_from_world.translation);
      EXPECT_EQ(model.cameras.at(id).params, start.cameras.at(id).params);
    }
  }
  {
    const Reconstruction model = adjust(Scope([](auto& s) { s.positions = false; }));
    for (const auto& [id, image] : start.images) {
      EXPECT_LT(
          (model.images.at(id).cam_from_world.Center() - image.cam_from_world.Center()).norm(),
          1e-12);
      EXPECT_NE(model.images.at(id).cam_from_world.rotation.coeffs(),
                image.cam_from_world.rotation.coeffs());
    }
  }
  {
    const Reconstruction model = adjust(Scope([](auto& s) { s.points = false; }));
    for (const auto& [id, point] : start.points3D) EXPECT_EQ(model.points3D.at(id).xyz, point.xyz);
    EXPECT_NE(model.images.at(1).cam_from_world.translation,
              start.images.at(1).cam_from_world.translation);
  }
  {
    const Reconstruction model = adjust(Scope([](auto& s) { s.rotations = s.positions = false; }));
    EXPECT_EQ(model.images.at(1).cam_from_world.translation,
              start.images.at(1).cam_from_world.translation);
    EXPECT_NE(model.points3D.at(1).xyz, start.points3D.at(1).xyz);
  }
  {
    const Reconstruction model =
        adjust(Scope([](auto& s) { s.focal_lengths = true, s.fixed_cameras = {2}; }));
    EXPECT_EQ(model.cameras.at(2).params, start.cameras.at(2).params);
    const std::vector<double>& before = start.cameras.at(1).params;
    const std::vector<double>& after = model.cameras.at(1).params;
    EXPECT_NE(after[0], before[0]);
    for (size_t k = 1; k < before.size(); ++k) EXPECT_EQ(after[k], before[k]);
  }
  {
    const Reconstruction model = adjust(Scope([](auto& s) {
      s.distortions = true, s.fixed_images = {1, 3};
    }));
    EXPECT_EQ(model.images.at(3).cam_from_world.translation,
              start.images.at(3).cam_from_world.translation);
    EXPECT_NE(model.images.at(2).cam_from_world.translation,
              start.images.at(2).cam_from_world.translation);
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(model.cameras.at(1).params[k], start.cameras.at(1).params[k]);
    }
    EXPECT_NE(model.cameras.at(1).params[3], start.cameras.at(1).params[3]);
  }
}

TEST(AdjustBundle, RobustLossesWithstandOutliers) {
  SyntheticOptions synthetic{.num_points = 400, .noise_px = 0.3, .outlier_share = 0.05};
  const MadeReconstruction scene = MakeSyntheticScene(synthetic);
  std::map<ReprojectionLoss, double> error;
  for (const auto& [loss, name] : kReprojectionLosses) {
    BundleAdjustmentOptions options = Precise();
    options.loss = loss;
    Reconstruction model = Perturbed(scene.truth, {0.005, 0.02, 0.02});
    AdjustBundle(model, {}, options, kOneThread);
    error[loss] = CompareAligned(model, scene.truth).center;
  }
  for (const auto& [loss, name] : kReprojectionLosses) {
    if (loss == ReprojectionLoss::kNone) continue;
    EXPECT_LT(error[loss], 0.2 * error[ReprojectionLoss::kNone]) << name;
  }
  EXPECT_LT(error[ReprojectionLoss::kCauchy], error[ReprojectionLoss::kHuber]);
}

TEST(AdjustBundle, LossScaleAndIterationsAndToleranceMatter) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.5, .outlier_share = 0.05});
  const auto run = [&](const BundleAdjustmentOptions& options, BundleAdjustmentReport* report) {
    Reconstruction model = Perturbed(scene.truth, {});
    *report = AdjustBundle(model, {}, options, kOneThread);
    return model.images.at(3).cam_from_world.translation;
  };
  BundleAdjustmentReport report, other;
  BundleAdjustmentOptions options = Precise();
  const Eigen::Vector3d reference = run(options, &report);
  options.loss_scale = 5;
  EXPECT_GT((run(options, &other) - reference).norm(), 1e-6);
  options = Precise();
  options.max_iterations = 2;
  run(options, &other);
  EXPECT_EQ(other.status, BundleAdjustmentStatus::kMaxIterations);
  EXPECT_LT(other.num_iterations, report.num_iterations);
  options = Precise();
  options.function_tolerance = 0.1;
  run(options, &other);
  EXPECT_EQ(other.status, BundleAdjustmentStatus::kConverged);
  EXPECT_LT(other.num_iterations, report.num_iterations);
}

TEST(AdjustBundle, OneThreadGivesEqualBytesAndMoreThreadsNearlySo) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.5, .outlier_share = 0.02});
  const Reconstruction start = Perturbed(scene.truth, {});
  const auto run = [&](int num_threads) {
    Reconstruction model = start;
    // The gauge is held, so that differences are those of the solution.
    AdjustBundle(model, Scope([](auto& s) {
                   s.fixed_images = {1, 6};
                 }),
                 Precise(), {.num_threads = num_threads});
    return model;
  };
  const Reconstruction first = run(1);
  const Reconstruction second = run(1);
  const Reconstruction third = run(4);
  ASSERT_EQ(first.images.size(), 6u);
  ASSERT_GT(first.points3D.size(), 150u);
  for (const auto& [id, image] : first.images) {
    EXPECT_EQ(image.cam_from_world.translation, second.images.at(id).cam_from_world.translation);
    EXPECT_EQ(image.cam_from_world.rotation.coeffs(),
              second.images.at(id).cam_from_world.rotation.coeffs());
    EXPECT_LT(
        (image.cam_from_world.translation - third.images.at(id).cam_from_world.translation).norm(),
        1e-6 * image.cam_from_world.translation.norm());
  }
  for (const auto& [id, point] : first.points3D) {
    EXPECT_EQ(point.xyz, second.points3D.at(id).xyz);
  }
}

TEST(AdjustBundle, TwoImagesAreEnough) {
  const MadeReconstruction scene = MakeSyntheticScene({.num_images = 2, .visible_share = 1.0});
  Reconstruction model =
      Perturbed(scene.truth, {.rotation = 0.01, .position = 0.05, .point = 0.05});
  EXPECT_LT(AdjustBundle(model, {}, Precise(), kOneThread).final_rmse, 1e-4);
}

TEST(AdjustBundle, NothingToAdjustIsSaidAndChangesNothing) {
  Reconstruction empty;
  EXPECT_EQ(AdjustBundle(empty, {}, Precise(), kOneThread).status,
            BundleAdjustmentStatus::kNoObservations);

  // All points behind all cameras.
  MadeReconstruction scene = MakeSyntheticScene({});
  for (auto& [id, point] : scene.truth.points3D) point.xyz = Eigen::Vector3d(0, 0, -100);
  Reconstruction model = scene.truth;
  EXPECT_EQ(AdjustBundle(model, {}, Precise(), kOneThread).status,
            BundleAdjustmentStatus::kNoObservations);
  EXPECT_EQ(model.images.at(1).cam_from_world.translation,
            scene.truth.images.at(1).cam_from_world.translation);

  // Nothing is free.
  model = MakeSyntheticScene({}).truth;
  const BundleAdjustmentScope nothing =
      Scope([](auto& s) { s.rotations = s.positions = s.points = false; });
  EXPECT_EQ(AdjustBundle(model, nothing, Precise(), kOneThread).status,
            BundleAdjustmentStatus::kNoObservations);
}

// Largest distance of a camera center from the truth, as they are.
double LargestShift(const Reconstruction& model, const Reconstruction& truth) {
  double largest = 0;
  for (const auto& [id, image] : truth.images) {
    const Eigen::Vector3d center = model.images.at(id).cam_from_world.Center();
    largest = std::max(largest, (center - image.cam_from_world.Center()).norm());
  }
  return largest;
}

TEST(AdjustBundle, PositionsGiveTheWorldItsFrame) {
  const Reconstruction truth = MakeSyntheticScene({}).truth;
  BundleAdjustmentScope scope;
  for (const auto& [id, image] : truth.images) {
    scope.image_positions[id] = {image.cam_from_world.Center(), {10, 10, 10}};
  }
  scope.image_positions[1].position.z() += 3;  // what is not known does not count
  scope.image_positions[1].precision.z() = 0;
  scope.image_positions[99] = {{0, 0, 0}, {1, 1, 1}};  // no image
  for (const auto& [solver, name] : kBundleSolvers) {
    BundleAdjustmentOptions options = Precise();
    options.solver = solver;
    Reconstruction model = Perturbed(truth, {});
    AdjustBundle(model, scope, options, kOneThread);
    // Conjugate gradients stop early where the frame is weak beside the points: a tenth of sigma.
    const bool is_iterative = solver == BundleSolver::kIterativeSchur;
    EXPECT_LT(LargestShift(model, truth), is_iterative ? 1e-2 : 1e-6) << name;
  }
  // With rotations, or all poses of some images, constant.
  for (const bool rotations : {false, true}) {
    scope.rotations = rotations;
    scope.fixed_images = {2};
    Reconstruction model = truth;
    for (auto& [id, point] : model.points3D) point.xyz.x() += 0.01;
    AdjustBundle(model, scope, Precise(), kOneThread);
    EXPECT_LT(LargestShift(model, truth), 1e-6);
  }
  // A wrong one pulls, but not in proportion.
  scope = {};
  for (const auto& [id, image] : truth.images) {
    scope.image_positions[id] = {image.cam_from_world.Center(), {10, 10, 10}};
  }
  double shifts[2];
  for (const double off : {10.0, 1000.0}) {
    scope.image_positions[3].position =
        truth.images.at(3).cam_from_world.Center() + Eigen::Vector3d(0, off, 0);
    Reconstruction model = truth;
    AdjustBundle(model, scope, Precise(), kOneThread);
    shifts[off > 100] = LargestShift(model, truth);
  }
  EXPECT_LT(shifts[1], 1.2 * shifts[0]);
  EXPECT_LT(shifts[1], 1);
}

TEST(AdjustBundle, SurveyedPointsGiveTheWorldItsFrame) {
  const Reconstruction truth = MakeSyntheticScene({}).truth;
  BundleAdjustmentScope scope;
  Reconstruction start = truth;
  for (point3D_t id = 1; id <= 5; ++id) {
    SurveyedPoint point{{truth.points3D.at(id).xyz, {100, 100, 100}}, {}};
    for (const TrackElement& element : truth.points3D.at(id).track) {
      point.pixels[element.image_id] = truth.images.at(element.image_id).points2D[element.point2D];
    }
    scope.surveyed_points.push_back(point);
    start.RemovePoint3D(id);
  }
  start.Transform({1.02, Eigen::Quaterniond(ExpSO3({0.01, 0.02, -0.01})), {0.1, -0.1, 0.2}});
  for (const auto& [solver, name] : kBundleSolvers) {
    BundleAdjustmentOptions options = Precise();
    options.solver = solver;
    Reconstruction model = start;
    AdjustBundle(model, scope, options, kOneThread);
    EXPECT_LT(LargestShift(model, truth), 1e-6) << name;
    EXPECT_EQ(model.points3D.size(), start.points3D.size());
  }
}

TEST(AdjustBundle, RefusesMeaninglessOptions) {
  Reconstruction model = MakeSyntheticScene({}).truth;
  BundleAdjustmentOptions options = Precise();
  options.loss = static_cast<ReprojectionLoss>(99);
  EXPECT_THROW(AdjustBundle(model, {}, options, kOneThread), ConfigError);
}

TEST(AdjustBundle, StopsWhenAsked) {
  class Stopper : public ProgressMonitor {
   public:
    bool StopRequested() const override { return true; }
  } stopper;
  Reconstruction model = Perturbed(MakeSyntheticScene({}).truth, {});
  EXPECT_EQ(AdjustBundle(model, {}, Precise(), {.num_threads = 1, .monitor = stopper}).status,
            BundleAdjustmentStatus::kStopped);
}

}  // namespace
}  // namespace cairn
