#include <algorithm>
#include <cmath>

#include "math/random_vectors.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"
#include "unit/bundle_adjustment/perturbed.h"

namespace cairn {
namespace {

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
Reconstruction SceneWithAPlaneInImage3(uint64_t seed,
                                       CameraModel camera_model = CameraModel::kSimpleRadial) {
  constexpr double kNoisePx = 0.5;
  Reconstruction model =
      MakeSyntheticScene(
          {.noise_px = kNoisePx, .model = camera_model, .shared_camera = false, .seed = seed})
          .truth;
  for (const int k : model.cameras.at(3).DistortionIndices()) model.cameras.at(3).params[k] = 0;
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
          kNoisePx * GaussianVector<2>(rng);
    }
  }
  return model;
}

// The corner of the pinhole picture is beyond the field of this lens, whose own corner has a ray.
TEST(AdjustBundle, DistortionsOfWideLensesHaveAPrior) {
  Reconstruction model = MakeSyntheticScene({.model = CameraModel::kSimpleDivision}).truth;
  for (auto& [id, camera] : model.cameras) {
    camera.SetMeanFocal(0.3 * camera.width);
    camera.params.back() = 0.2;
  }
  const BundleAdjustmentScope scope = IntrinsicsScope(model, 0.1);
  EXPECT_NE(AdjustBundle(model, scope, {}).status, BundleAdjustmentStatus::kFailed);
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
  for (const CameraModel camera_model : {CameraModel::kSimpleRadial, CameraModel::kPinhole}) {
    const Reconstruction start = SceneWithAPlaneInImage3(1, camera_model);
    for (const double factor : {0.9, 1.2}) {
      Reconstruction model = start;
      BundleAdjustmentScope scope = IntrinsicsScope(start, 0.001);
      for (const int k : start.cameras.at(3).FocalIndices()) scope.priors.at(3).params[k] *= factor;
      AdjustBundle(model, scope, Precise(), kOneThread);
      const double change = model.cameras.at(3).MeanFocal() / start.cameras.at(3).MeanFocal();
      EXPECT_NEAR(change, factor, 0.02) << CameraModelName(camera_model);
    }
  }
}

// Image 3 sees few points, close to one row: how high its pixels are is open.
Reconstruction SceneWithARowInImage3(uint64_t seed) {
  Reconstruction model =
      MakeSyntheticScene(
          {.num_points = 1000, .noise_px = 0.5, .shared_camera = false, .seed = seed})
          .truth;
  const RegisteredImage& image = model.images.at(3);
  const double row = 0.5 * model.CameraOf(image).height;
  for (size_t k = 0; k < image.points2D.size(); ++k) {
    if (std::abs(image.points2D[k].y() - row) <= 2) continue;
    model.RemoveObservation(image.point3D_ids[k], {3, static_cast<point2D_t>(k)});
  }
  return model;
}

TEST(AdjustBundle, APriorHoldsPixelsSquareWhereNothingTellsTheirShape) {
  double without_prior = 0;
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const Reconstruction start = SceneWithARowInImage3(seed);
    const auto shape = [&](double focal_sigma) {
      Reconstruction model = start;
      AdjustBundle(model, IntrinsicsScope(start, focal_sigma), Precise(), kOneThread);
      const Camera& camera = model.cameras.at(3);
      return std::abs(std::log(camera.FocalX() / camera.FocalY()));
    };
    EXPECT_LT(shape(0.7), 0.03);
    without_prior = std::max(without_prior, shape(0));
  }
  EXPECT_GT(without_prior, 0.1);
}

TEST(AdjustBundle, PixelsThatAreNotSquareAreFoundInSpiteOfThePrior) {
  const Reconstruction truth = MakeSyntheticScene({.num_points = 500, .noise_px = 0.5}).truth;
  Reconstruction model = truth;
  model.cameras.at(1).params[1] *= 1.07;
  AdjustBundle(model, IntrinsicsScope(model, 0.7), Precise(), kOneThread);
  for (const int k : truth.cameras.at(1).FocalIndices()) {
    EXPECT_NEAR(model.cameras.at(1).params[k] / truth.cameras.at(1).params[k], 1, 0.01);
  }
}

// A long lens far away, whose photographs are cropped off the center: rotations nearly undo that.
Reconstruction LongLensOffCenter(const Eigen::Vector2d& offset_px) {
  Reconstruction model = MakeSyntheticScene({.num_images = 12, .num_points = 500}).truth;
  for (auto& [id, camera] : model.cameras) camera.SetMeanFocal(6 * camera.MeanFocal());
  for (auto& [id, image] : model.images) image.cam_from_world.translation.z() *= 6;
  for (const auto& [id, point] : model.points3D) {
    for (const TrackElement& element : point.track) {
      RegisteredImage& image = model.images.at(element.image_id);
      image.points2D[element.point2D] =
          model.CameraOf(image).ImgFromCam((image.cam_from_world * point.xyz).hnormalized()) +
          offset_px;
    }
  }
  AdjustBundle(model, {}, Precise(), kOneThread);
  return model;
}

TEST(AdjustBundle, PrincipalPointsOfLongLensesMoveWithinAFewIterations) {
  const Reconstruction start = LongLensOffCenter({30, -20});
  const Camera& camera = start.cameras.at(1);
  BundleAdjustmentScope scope;
  scope.principal_points = true;
  scope.priors[1] = {.params = camera.params, .principal_point_sigma_px = 100};
  const auto found = [&](int max_iterations) {
    Reconstruction model = start;
    BundleAdjustmentOptions options = Precise();
    options.max_iterations = max_iterations;
    AdjustBundle(model, scope, options, kOneThread);
    return model.cameras.at(1).PrincipalPoint();
  };
  const Eigen::Vector2d end = found(200);
  EXPECT_GT((end - camera.PrincipalPoint()).norm(), 20);
  EXPECT_LT((found(4) - end).norm(), 0.2 * (end - camera.PrincipalPoint()).norm());
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

}  // namespace
}  // namespace cairn
