#include "evaluation/model_evidence.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cairn/base/rng.h"
#include "cairn/geometry/rigid3d.h"
#include "math/random_vectors.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"

namespace cairn {
namespace {

// All pairs of images, with the matches that their common points give.
struct Pairs {
  explicit Pairs(const Reconstruction& truth) {
    for (const auto& [id, point] : truth.points3D) {
      for (size_t a = 0; a < point.track.size(); ++a) {
        for (size_t b = a + 1; b < point.track.size(); ++b) {
          const TrackElement &first = point.track[a], &second = point.track[b];
          matches[{first.image_id, second.image_id}].push_back({first.point2D, second.point2D});
        }
      }
    }
    for (const auto& [ids, found] : matches) views.push_back({ids.first, ids.second, &found});
  }
  std::map<std::pair<image_t, image_t>, FeatureMatches> matches;
  std::vector<VerifiedPair> views;
};

Reconstruction Turned(Reconstruction model, image_t id, double angle) {
  Rigid3d& pose = model.images.at(id).cam_from_world;
  const Eigen::Vector3d center = pose.Center();
  pose.rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()) * pose.rotation;
  pose.translation = pose.rotation * -center;
  return model;
}

TEST(ModelEvidence, TheTruthExplainsAllMatches) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.3});
  const Pairs pairs(scene.truth);
  const ModelEvidence evidence = EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 1});
  EXPECT_EQ(evidence.all.num_explained, evidence.all.num_matches);
  EXPECT_EQ(evidence.inside.num_matches, evidence.all.num_matches);
  EXPECT_EQ(evidence.num_pairs, 15);
  EXPECT_EQ(evidence.num_contradicted, 0);
  EXPECT_EQ(evidence.pairs.size(), pairs.views.size());
  // Some six nats a match that does not follow from others: the logarithm of the image's width over
  // the noise.
  EXPECT_EQ(evidence.num_independent, CountIndependent(pairs.views));
  EXPECT_GT(evidence.nats, 4.5 * static_cast<double>(evidence.num_independent));
  EXPECT_LT(evidence.nats, 7.0 * static_cast<double>(evidence.num_independent));
}

TEST(ModelEvidence, AGainThatAllImagesShareIsBeyondDoubtAndOneOfASingleImageIsNot) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.3});
  const Pairs pairs(scene.truth);
  const auto evidence = [&](const Reconstruction& model) {
    return EvaluateAgreement(model, pairs.views, {.num_threads = 1});
  };
  const Agreement truth = evidence(scene.truth);
  Reconstruction wrong_lens = scene.truth;
  for (auto& [id, camera] : wrong_lens.cameras) camera.SetMeanFocal(1.1 * camera.MeanFocal());
  EXPECT_GT(StandardErrorsOfGain(evidence(wrong_lens), truth), 3);
  EXPECT_LT(StandardErrorsOfGain(truth, evidence(wrong_lens)), -3);
  const image_t first = scene.truth.images.begin()->first;
  const double of_one = StandardErrorsOfGain(evidence(Turned(scene.truth, first, 0.01)), truth);
  EXPECT_GT(of_one, 0.5);
  EXPECT_LT(of_one, 2);
  EXPECT_EQ(StandardErrorsOfGain(truth, truth), 0);
}

// All images agree a little less with a wrong lens, by errors that only a sharp eye sees. In the
// other model, one image is turned, and its pairs fall apart.
TEST(ModelEvidence, NoGainIsSharpWhereTheWholeFallsApart) {
  const MadeReconstruction scene = MakeSyntheticScene({.num_images = 12, .noise_px = 0.1});
  const Pairs pairs(scene.truth);
  const auto evidence = [&](const Reconstruction& model) {
    return EvaluateAgreement(model, pairs.views, {.num_threads = 1});
  };
  Reconstruction lens = scene.truth;
  for (auto& [id, camera] : lens.cameras) camera.SetMeanFocal(1.02 * camera.MeanFocal());
  const Agreement wrong_lens = evidence(lens);
  Agreement turned = evidence(Turned(scene.truth, scene.truth.images.begin()->first, 0.3));
  EXPECT_GT(turned.sharp_nats, wrong_lens.sharp_nats);
  EXPECT_LT(turned.whole_nats, wrong_lens.whole_nats);
  EXPECT_EQ(StandardErrorsOfGain(wrong_lens, turned), 0);
  turned.whole_nats = wrong_lens.whole_nats + 1;
  EXPECT_GT(StandardErrorsOfGain(wrong_lens, turned), 1);
}

// Points so far away that a pixel puts them behind the cameras: what the whole standard deviation
// leaves open, the sharp one tells.
TEST(ModelEvidence, ASharpEyeSeesFarPointsBehindTheCameras) {
  const auto agreement = [](double shift_px) {
    Reconstruction model;
    model.cameras[1] = Camera::FromFocal(1, CameraModel::kSimplePinhole, 400, 900, 700);
    FeatureMatches matches;
    for (const image_t id : {1, 2}) {
      RegisteredImage& image = model.images[id];
      image.image.image_id = id;
      image.image.camera_id = 1;
      for (point2D_t k = 0; k < 50; ++k) {
        image.points2D.emplace_back(100 + 10 * k + (id == 2 ? shift_px : 0), 150 + 7 * k);
        image.point3D_ids.push_back(kInvalidPoint3DId);
        if (id == 1) matches.push_back({k, k});
      }
    }
    model.images.at(2).cam_from_world.translation = Eigen::Vector3d(-1, 0, 0);
    const VerifiedPair pair{1, 2, &matches};
    return EvaluateAgreement(model, {&pair, 1}, {.num_threads = 1});
  };
  EXPECT_GT(agreement(-1).sharp_nats, agreement(-1).whole_nats);
  EXPECT_GT(agreement(1).whole_nats, 100);
  EXPECT_EQ(agreement(1).sharp_nats, 0);
}

// Student's t of one in a thousand is 4.297 with 9 degrees of freedom, and 3.174 with 99; the
// normal distribution's is 3.090.
TEST(NormalDeviate, IsAsUnlikelyAsStudentsT) {
  EXPECT_NEAR(NormalDeviate(4.297, 9), 3.090, 0.01);
  EXPECT_NEAR(NormalDeviate(3.174, 99), 3.090, 0.01);
  EXPECT_NEAR(NormalDeviate(-4.297, 9), -3.090, 0.01);
}

// Two photographs by one lens, with keypoints that err by half a pixel.
struct TwoPhotographs {
  explicit TwoPhotographs(const Camera& camera) {
    Rng rng(3);
    model.cameras[1] = camera;
    for (const image_t id : {1, 2}) {
      RegisteredImage& image = model.images[id];
      image.image.image_id = id;
      image.image.camera_id = 1;
    }
    model.images.at(2).cam_from_world = {ExpSO3(Eigen::Vector3d(0.1, -0.3, 0.2)),
                                         Eigen::Vector3d(-0.8, 0.1, 0.3)};
    while (matches.size() < 200) {
      const Eigen::Vector3d xyz = UniformVector({{-4, 4}, {-3, 3}, {2, 5}}, rng);
      std::vector<Eigen::Vector2d> pixels;
      for (const auto& [id, image] : model.images) {
        const auto pixel = camera.ImgFromRay(image.cam_from_world * xyz);
        if (!pixel) break;
        const Eigen::Vector2d noisy = *pixel + 0.5 * GaussianVector<2>(rng);
        const bool is_inside = (noisy.array() > 0).all() && noisy.x() < camera.width &&
                               noisy.y() < camera.height && camera.RayFromImg(noisy);
        if (is_inside) pixels.push_back(noisy);
      }
      if (pixels.size() < 2) continue;
      const auto k = static_cast<point2D_t>(matches.size());
      matches.push_back({k, k});
      for (auto& [id, image] : model.images) {
        image.points2D.push_back(pixels[id - 1]);
        image.point3D_ids.push_back(kInvalidPoint3DId);
      }
    }
  }

  // By differences of pixels.
  double SquaredSampsonErrorPx(size_t k) const {
    const Camera& camera = model.cameras.at(1);
    const Rigid3d& pose = model.images.at(2).cam_from_world;
    const auto error = [&](const Eigen::Vector4d& pixels) {
      const Eigen::Vector3d ray1 = *camera.RayFromImg(pixels.head<2>());
      const Eigen::Vector3d ray2 = *camera.RayFromImg(pixels.tail<2>());
      return ray2.dot(pose.translation.cross(pose.rotation * ray1));
    };
    Eigen::Vector4d at, gradient;
    at << model.images.at(1).points2D[k], model.images.at(2).points2D[k];
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector4d step = 1e-4 * Eigen::Vector4d::Unit(i);
      gradient[i] = (error(at + step) - error(at - step)) / 2e-4;
    }
    return error(at) * error(at) / gradient.squaredNorm();
  }

  Reconstruction model;
  FeatureMatches matches;
};

TEST(ModelEvidence, ErrorsArePixelsWhateverTheLens) {
  for (const CameraModel lens : {CameraModel::kSimplePinhole, CameraModel::kSimpleRadial,
                                 CameraModel::kSimpleRadialFisheye}) {
    Camera camera = Camera::FromFocal(1, lens, 400, 900, 700);
    if (lens == CameraModel::kSimpleRadial) camera.params.back() = -0.05;
    const TwoPhotographs pair(camera);
    const VerifiedPair verified = {1, 2, &pair.matches};
    const ModelEvidence evidence = EvaluateEvidence(pair.model, {&verified, 1}, {});
    const double sigma_px = 1;  // (half of 0.1 % of the diagonal is less)
    const double width_px = 900 * 700 / camera.DiagonalPx();
    double nats = 0;
    for (size_t k = 0; k < pair.matches.size(); ++k) {
      nats += std::log(width_px / (sigma_px * std::sqrt(2 * std::numbers::pi))) -
              0.5 * pair.SquaredSampsonErrorPx(k) / (sigma_px * sigma_px);
    }
    EXPECT_EQ(evidence.all.num_explained, 200) << CameraModelName(lens);
    EXPECT_NEAR(evidence.all.nats, nats, 1e-3 * nats) << CameraModelName(lens);
  }
}

TEST(ModelEvidence, MatchesThatFollowFromOthersDoNotCount) {
  // Keypoint 0 of four images is one point, keypoint 1 of two another.
  const FeatureMatches both = {{0, 0}, {1, 1}}, one = {{0, 0}};
  const std::vector<VerifiedPair> chain = {{1, 2, &both}, {2, 3, &one}, {3, 4, &one}};
  EXPECT_EQ(CountIndependent(chain), 4);
  std::vector<VerifiedPair> all = chain;
  for (const auto& [a, b] : {std::pair(1, 3), std::pair(1, 4), std::pair(2, 4)}) {
    all.push_back({static_cast<image_t>(a), static_cast<image_t>(b), &one});
  }
  EXPECT_EQ(CountIndependent(all), 4);
  EXPECT_EQ(CountIndependent({}), 0);
}

// Three cameras on a line: where the third one stands on it, no pair can tell. In its right place,
// points hold all three keypoints together; elsewhere only two.
TEST(ModelEvidence, PointsShowWhatPairsDoNotSee) {
  Reconstruction truth = MakeSyntheticScene({.num_images = 3, .visible_share = 1}).truth;
  for (auto& [id, image] : truth.images) {
    image.cam_from_world.translation =
        image.cam_from_world.rotation * -Eigen::Vector3d(4.0 * id - 8, 1, -7);
  }
  for (const auto& [id, point] : truth.points3D) {
    for (const TrackElement& element : point.track) {
      RegisteredImage& image = truth.images.at(element.image_id);
      image.points2D[element.point2D] =
          *truth.CameraOf(image).ImgFromRay(image.cam_from_world * point.xyz);
    }
  }
  const Pairs pairs(truth);
  Reconstruction wrong = truth;
  RegisteredImage& third = wrong.images.at(3);
  third.cam_from_world.translation = third.cam_from_world.rotation * -Eigen::Vector3d(5, 1, -7);
  for (size_t k = 0; k < third.points2D.size(); ++k) {
    wrong.RemoveObservation(third.point3D_ids[k], {3, static_cast<point2D_t>(k)});
  }
  const auto num_points = static_cast<int64_t>(truth.points3D.size());
  const ModelEvidence right = EvaluateEvidence(truth, pairs.views, {.num_threads = 1});
  const ModelEvidence less = EvaluateEvidence(wrong, pairs.views, {.num_threads = 1});
  EXPECT_EQ(right.all.num_explained, 3 * num_points);
  EXPECT_EQ(less.all.num_explained, 3 * num_points);
  EXPECT_EQ(right.num_independent, 2 * num_points);
  EXPECT_EQ(less.num_independent, num_points);
  EXPECT_LT(less.nats, 0.6 * right.nats);
  // A track without any point, of rays that are nearly parallel, is not held against a model.
  while (!wrong.points3D.empty()) wrong.RemovePoint3D(wrong.points3D.begin()->first);
  EXPECT_EQ(EvaluateEvidence(wrong, pairs.views, {.num_threads = 1}).num_independent,
            right.num_independent);
}

// A filter that takes away observations changes the points by nothing but these.
TEST(ModelEvidence, DoesNotDependOnTheModelsFilters) {
  Reconstruction model = MakeSyntheticScene({.num_images = 4, .visible_share = 1}).truth;
  const Pairs pairs(model);
  const ModelEvidence before = EvaluateEvidence(model, pairs.views, {.num_threads = 1});
  RegisteredImage& image = model.images.at(2);
  for (point2D_t k = 0; k < image.points2D.size(); k += 2) {
    model.RemoveObservation(image.point3D_ids[k], {2, k});
  }
  const ModelEvidence filtered = EvaluateEvidence(model, pairs.views, {.num_threads = 1});
  EXPECT_EQ(filtered.num_independent, before.num_independent);
  EXPECT_EQ(filtered.nats, before.nats);
}

// Two sides of a box with one logo, each photographed by many, and few photographs around the edge:
// the model that shows the two sides as one explains more pairs, all by one coincidence a point.
TEST(ModelEvidence, OneSideShownOnTopOfAnotherHasLess) {
  constexpr int kPerSide = 8, kLogo = 30, kEdge = 60, kSeers = 2;
  Rng rng(1);
  const auto draw = [&](int num, double width) {
    std::vector<Eigen::Vector3d> points;
    for (int k = 0; k < num; ++k) {
      const double z = 0.5 * rng.Uniform();
      const double y = width * (rng.Uniform() - 0.5);
      points.emplace_back(width * (rng.Uniform() - 0.5), y, z);
    }
    return points;
  };
  const std::vector<Eigen::Vector3d> logo = draw(kLogo, 2), edge = draw(kEdge, 3);
  const Rigid3d turn{Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitY())),
                     Eigen::Vector3d(3, 0, 1)};  // of the first side onto the second one
  Reconstruction truth, fold;
  truth.cameras[1] = fold.cameras[1] = Camera::FromFocal(1, CameraModel::kPinhole, 500, 640, 480);
  for (int i = 0; i < 2 * kPerSide; ++i) {
    const bool is_second = i >= kPerSide;
    RegisteredImage image;
    image.image = {static_cast<image_t>(i + 1), "image", 1};
    const Rigid3d before{Eigen::Quaterniond::Identity(),
                         Eigen::Vector3d(0.4 * (i % kPerSide) - 1.5, 0.1 * i, 6)};
    image.cam_from_world = is_second ? before * Inverse(turn) : before;
    const auto see = [&](const Eigen::Vector3d& point) {
      const auto pixel = truth.cameras[1].ImgFromRay(image.cam_from_world * point);
      image.points2D.push_back(pixel.value_or(Eigen::Vector2d::Zero()));
    };
    for (const Eigen::Vector3d& point : logo) see(is_second ? turn * point : point);
    for (const Eigen::Vector3d& point : edge) see(point);
    image.point3D_ids.assign(image.points2D.size(), kInvalidPoint3DId);
    truth.images[i + 1] = image;
    image.cam_from_world = before;
    fold.images[i + 1] = image;
  }
  FeatureMatches of_logo, of_edge, of_both;
  for (int k = 0; k < kLogo + kEdge; ++k) {
    const auto point = static_cast<point2D_t>(k);
    (k < kLogo ? of_logo : of_edge).push_back({point, point});
    of_both.push_back({point, point});
  }
  std::vector<VerifiedPair> pairs;
  for (int a = 0; a < 2 * kPerSide; ++a) {
    for (int b = a + 1; b < 2 * kPerSide; ++b) {
      const bool see_edge = a % kPerSide < kSeers && b % kPerSide < kSeers;
      const bool see_one_side = (a < kPerSide) == (b < kPerSide);
      pairs.push_back({static_cast<image_t>(a + 1), static_cast<image_t>(b + 1),
                       !see_edge      ? &of_logo
                       : see_one_side ? &of_both
                                      : &of_edge});
    }
  }
  const ModelEvidence right = EvaluateEvidence(truth, pairs), wrong = EvaluateEvidence(fold, pairs);
  EXPECT_GT(wrong.all.num_explained, 1.5 * right.all.num_explained);
  EXPECT_GT(right.nats, 1.05 * wrong.nats);
}

TEST(ModelEvidence, DoesNotDependOnTheWorldFrameOrOnThreads) {
  const MadeReconstruction scene = MakeSyntheticScene({.num_images = 24, .noise_px = 0.5});
  const Pairs pairs(scene.truth);  // 276, so that threads have some each
  const double nats = EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 1}).nats;
  EXPECT_EQ(EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 8}).nats, nats);
  EXPECT_EQ(CountIndependent(pairs.views, 8), CountIndependent(pairs.views, 1));
  Reconstruction moved = scene.truth;
  Sim3d change;
  change.scale = 7;
  change.rotation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized();
  change.translation = Eigen::Vector3d(3, -2, 5);
  moved.Transform(change);
  EXPECT_NEAR(EvaluateEvidence(moved, pairs.views, {.num_threads = 1}).nats, nats, 1e-6 * nats);
}

// Pairs that are read a part at a time have the support that they have together. One image is
// turned, so that supports differ.
TEST(ModelEvidence, SupportsOfPartsAreThoseOfAll) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.5});
  const Pairs pairs(scene.truth);
  const Reconstruction model = Turned(scene.truth, scene.truth.images.begin()->first, 0.3);
  const ModelEvidence together = EvaluateEvidence(model, pairs.views, {.num_threads = 1});
  constexpr size_t kAtATime = 4;
  size_t num_read = 0;
  const auto read = [&] {
    const size_t num = std::min(kAtATime, pairs.views.size() - num_read);
    num_read += num;
    return std::span<const VerifiedPair>(pairs.views).subspan(num_read - num, num);
  };
  const std::vector<Support> supports = EvaluateSupports(model, read, {.num_threads = 2});
  ASSERT_EQ(supports.size(), together.pairs.size());
  EXPECT_GT(together.num_contradicted, 0);
  for (size_t i = 0; i < supports.size(); ++i) {
    EXPECT_EQ(supports[i].num_matches, together.pairs[i].num_matches);
    EXPECT_EQ(supports[i].num_explained, together.pairs[i].num_explained);
    EXPECT_EQ(supports[i].nats, together.pairs[i].nats);
  }
}

// Two cameras of the same parameters explain what one explains, and are longer to describe: by half
// the logarithm of the images' matches for each of focal length and distortion.
TEST(ModelEvidence, EveryCameraCostsItsParameters) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.3});
  const Pairs pairs(scene.truth);
  Reconstruction two = scene.truth;
  const image_t last = two.images.rbegin()->first;
  Camera own = two.cameras.begin()->second;
  const camera_t first = own.camera_id;
  own.camera_id = 99;
  two.cameras[99] = own;
  two.images.at(last).image.camera_id = 99;
  const ModelEvidence with_one = EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 1});
  const ModelEvidence with_two = EvaluateEvidence(two, pairs.views, {.num_threads = 1});
  int64_t all = 0;
  for (const auto& [id, support] : with_one.images) all += support.num_matches;
  const int64_t of_last = with_one.images.at(last).num_matches;
  const double num_parameters = own.FocalIndices().size() + own.DistortionIndices().size();
  const auto log = [](int64_t num) { return std::log(static_cast<double>(num)); };
  EXPECT_NEAR(with_one.nats - with_two.nats,
              0.5 * num_parameters * (log(of_last) + log(all - of_last) - log(all)), 1e-6);
  // What is known beforehand need not be described.
  const double nats = EvaluateEvidence(scene.truth, pairs.views, {}, {first}).nats;
  EXPECT_NEAR(EvaluateEvidence(two, pairs.views, {}, {first, 99}).nats, nats, 1e-6);
  EXPECT_GT(nats, with_one.nats);
}

TEST(ModelEvidence, AWrongPoseIsContradictedByItsOwnPairs) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.3});
  const Pairs pairs(scene.truth);
  const ModelEvidence truth = EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 1});
  const ModelEvidence wrong =
      EvaluateEvidence(Turned(scene.truth, 3, 0.1), pairs.views, {.num_threads = 1});
  EXPECT_LT(wrong.nats, truth.nats);
  // (A pair may have its epipole where the turn moves points along the lines.)
  EXPECT_GE(wrong.num_contradicted, 4);
  EXPECT_TRUE(wrong.images.at(3).IsContradicted());
  EXPECT_FALSE(wrong.images.at(1).IsContradicted());
  // A focal length that is off, too, though by less.
  Reconstruction other = scene.truth;
  for (auto& [id, camera] : other.cameras) camera.SetMeanFocal(1.2 * camera.MeanFocal());
  EXPECT_LT(EvaluateEvidence(other, pairs.views, {.num_threads = 1}).nats, truth.nats);
}

TEST(ModelEvidence, PointsBehindACameraAreNotExplained) {
  const MadeReconstruction scene = MakeSyntheticScene({});
  const Pairs pairs(scene.truth);
  // The world seen from the other side: every epipolar line stays, every point lies behind.
  Reconstruction mirrored = scene.truth;
  for (auto& [id, image] : mirrored.images) image.cam_from_world.translation *= -1;
  const ModelEvidence evidence = EvaluateEvidence(mirrored, pairs.views, {.num_threads = 1});
  EXPECT_LT(evidence.all.Share(), 0.05);
}

// A camera that is turned by half a turn about the baseline sees the same epipolar lines, and every
// point lies behind one of the two (the twisted pair; Hartley and Zisserman, 9.6.2).
TEST(ModelEvidence, PointsBehindOneOfTwoCamerasAreNotExplained) {
  const MadeReconstruction scene = MakeSyntheticScene({});
  const Pairs pairs(scene.truth);
  const VerifiedPair& pair = pairs.views.front();
  for (const image_t id : {pair.image_id1, pair.image_id2}) {
    Reconstruction twisted = scene.truth;
    const Eigen::Vector3d baseline = (twisted.images.at(pair.image_id2).cam_from_world.Center() -
                                      twisted.images.at(pair.image_id1).cam_from_world.Center())
                                         .normalized();
    Rigid3d& pose = twisted.images.at(id).cam_from_world;
    const Eigen::Vector3d center = pose.Center();
    pose.rotation = pose.rotation * Eigen::AngleAxisd(std::numbers::pi, baseline);
    pose.translation = pose.rotation * -center;
    const ModelEvidence evidence = EvaluateEvidence(twisted, {&pair, 1}, {.num_threads = 1});
    EXPECT_LT(evidence.all.Share(), 0.05) << id;
  }
}

TEST(ModelEvidence, AnImageThatIsMissingCostsItsMatches) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.3});
  const Pairs pairs(scene.truth);
  Reconstruction smaller = scene.truth;
  for (size_t k = 0; k < smaller.images.at(2).point3D_ids.size(); ++k) {
    const point3D_t id = smaller.images.at(2).point3D_ids[k];
    if (id != kInvalidPoint3DId) smaller.RemoveObservation(id, {2, static_cast<point2D_t>(k)});
  }
  smaller.images.erase(2);
  const ModelEvidence all = EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 1});
  const ModelEvidence less = EvaluateEvidence(smaller, pairs.views, {.num_threads = 1});
  EXPECT_LT(less.nats, all.nats);
  EXPECT_EQ(less.all.num_matches, all.all.num_matches);
  EXPECT_LT(less.inside.num_matches, all.inside.num_matches);
  EXPECT_EQ(less.num_pairs, 10);
  EXPECT_EQ(less.num_contradicted, 0);
}

}  // namespace
}  // namespace cairn
