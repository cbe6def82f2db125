#include "cairn/bundle_adjustment/bundle_adjustment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "unit/bundle_adjustment/perturbed.h"

namespace cairn {
namespace {

BundleAdjustmentScope Scope(const std::function<void(BundleAdjustmentScope&)>& change) {
  BundleAdjustmentScope scope;
  change(scope);
  return scope;
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

TEST(AdjustBundle, RefinesFocalLengthAndDistortionOfEveryModel) {
  for (const CameraModel model_kind :
       {CameraModel::kSimplePinhole, CameraModel::kPinhole, CameraModel::kSimpleRadial,
        CameraModel::kRadial, CameraModel::kOpenCV, CameraModel::kSimpleRadialFisheye,
        CameraModel::kSimpleDivision, CameraModel::kFov, CameraModel::kEucm}) {
    for (const bool shared : {true, false}) {
      SyntheticOptions synthetic{.num_images = 8, .model = model_kind, .shared_camera = shared};
      const MadeReconstruction scene = MakeSyntheticScene(synthetic);
      Reconstruction model = Perturbed(scene.truth, {.focal = 0.05});
      for (auto& [id, camera] : model.cameras) {
        for (const int k : camera.DistortionIndices()) camera.params[k] = 0;
        if (model_kind == CameraModel::kEucm) camera.params[5] = 1;  // beta
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

TEST(AdjustBundle, RefusesMeaninglessOptions) {
  Reconstruction model = MakeSyntheticScene({}).truth;
  BundleAdjustmentOptions options = Precise();
  options.loss = static_cast<ReprojectionLoss>(99);
  EXPECT_THROW(AdjustBundle(model, {}, options, kOneThread), ConfigError);
}

// A library is called by programs that were written in a hurry.
TEST(AdjustBundle, RefusesPartsThatDoNotFitTogether) {
  using Change = std::function<void(Reconstruction&, BundleAdjustmentScope&)>;
  const std::vector<Change> changes = {
      [](auto& model, auto&) { model.cameras.clear(); },
      [](auto& model, auto&) { model.cameras.begin()->second.params.pop_back(); },
      [](auto& model, auto&) {
        model.cameras.begin()->second.model = static_cast<CameraModel>(99);
      },
      [](auto& model, auto&) { model.images.begin()->second.sigmas_px = {1.0F}; },
      [](auto& model, auto&) { model.points3D.begin()->second.track[0].image_id = 77; },
      [](auto& model, auto&) { model.points3D.begin()->second.track[0].point2D = 123456; },
      [](auto& model, auto& scope) {
        scope.priors[model.cameras.begin()->first] = {{1.0}, 0.1, 0};
      },
      [](auto&, auto& scope) {
        scope.surveyed_points.push_back({{{0, 0, 0}, {1, 1, 1}}, {{77, {1, 1}}}});
      },
  };
  for (size_t i = 0; i < changes.size(); ++i) {
    Reconstruction model = MakeSyntheticScene({}).truth;
    BundleAdjustmentScope scope;
    changes[i](model, scope);
    EXPECT_THROW(AdjustBundle(model, scope, Precise(), kOneThread), ConfigError) << i;
  }
}

TEST(AdjustBundle, NamesWhatIsNoNumber) {
  const double nan = std::nan("");
  using Change = std::function<void(Reconstruction&, BundleAdjustmentScope&)>;
  const std::vector<std::pair<std::string, Change>> changes = {
      {"camera 1", [](auto& model, auto&) { model.cameras.at(1).SetMeanFocal(-5); }},
      {"image 2",
       [&](auto& model, auto&) { model.images.at(2).cam_from_world.translation.x() = nan; }},
      {"point ", [&](auto& model, auto&) { model.points3D.begin()->second.xyz.z() = nan; }},
      {"point ",
       [&](auto& model, auto&) {
         const TrackElement& first = model.points3D.begin()->second.track[0];
         model.images.at(first.image_id).points2D[first.point2D].x() = nan;
       }},
      {"point ",
       [](auto& model, auto&) {
         RegisteredImage& image = model.images.at(1);
         image.sigmas_px.assign(image.points2D.size(), 0.0F);
       }},
      {"camera 1",
       [&](auto& model, auto& scope) {
         scope.focal_lengths = true;
         scope.priors[1] = {model.cameras.at(1).params, nan, 0};
       }},
      {"image 2",
       [&](auto&, auto& scope) {
         scope.image_positions[2] = {{0, nan, 0}, {1, 1, 1}};
       }},
  };
  for (const auto& [what, change] : changes) {
    Reconstruction model = MakeSyntheticScene({}).truth;
    BundleAdjustmentScope scope;
    change(model, scope);
    const BundleAdjustmentReport report = AdjustBundle(model, scope, Precise(), kOneThread);
    EXPECT_EQ(report.status, BundleAdjustmentStatus::kFailed) << what;
    EXPECT_NE(report.fault.find(what), std::string::npos) << report.fault;
  }
}

TEST(AdjustBundle, StopsWhenAsked) {
  for (const auto& [solver, name] : kBundleSolvers) {
    TestMonitor stopper(0);
    BundleAdjustmentOptions options = Precise();
    options.solver = solver;
    Reconstruction model = Perturbed(MakeSyntheticScene({}).truth, {});
    EXPECT_EQ(AdjustBundle(model, {}, options, {.num_threads = 1, .monitor = stopper}).status,
              BundleAdjustmentStatus::kStopped)
        << name;
  }
}

}  // namespace
}  // namespace cairn
