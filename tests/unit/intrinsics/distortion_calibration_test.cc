#include "intrinsics/distortion_calibration.h"

#include <cmath>

#include "cairn/base/rng.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/math/so3.h"
#include "intrinsics/distorted_pair.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

constexpr int kWidth = 1000, kHeight = 750;

struct Lens {
  double focal_px = 1000;
  double k = 0;
};

Camera MakeCamera(camera_t id, double focal_px, double k) {
  Camera camera = Camera::FromFocal(id, CameraModel::kSimpleRadial, focal_px, kWidth, kHeight);
  camera.params.back() = k;
  return camera;
}

struct PairOptions {
  int num_right = 150, num_wrong = 50;
  double noise_px = 0.5;
  bool is_forward = false;  // along the optical axis
};

// Two images of points anywhere in both of them. The matrix to start from is the true one of rays
// that nominal focal lengths give, which explains what is near the image's middle.
DistortionPair MakePair(camera_t id1, const Lens& lens1, camera_t id2, const Lens& lens2,
                        uint64_t seed, const PairOptions& options = {}) {
  Rng rng(seed, "pair");
  const Camera camera1 = MakeCamera(id1, lens1.focal_px, lens1.k);
  const Camera camera2 = MakeCamera(id2, lens2.focal_px, lens2.k);
  const auto small = [&] { return rng.Uniform(-0.2, 0.2); };
  const Eigen::Vector3d translation = UniformVector({{0.5, 1.0}, {-0.2, 0.2}, {-0.2, 0.2}}, rng);
  Rigid3d pose(ExpSO3({small(), small(), small()}), translation);
  if (options.is_forward) pose = Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, -1});
  DistortionPair pair;
  pair.camera_id1 = id1;
  pair.camera_id2 = id2;
  const auto in_image = [&](const Eigen::Vector2d& p) {
    return p.x() > 0 && p.y() > 0 && p.x() < kWidth && p.y() < kHeight;
  };
  const auto noisy = [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return p + options.noise_px * GaussianVector<2>(rng);
  };
  for (int tries = 0; std::ssize(pair.pixels1) < options.num_right && tries < 100000; ++tries) {
    const Eigen::Vector2d pixel = UniformVector({{0, kWidth}, {0, kHeight}}, rng);
    const auto ray = camera1.CamFromImg(pixel);
    if (!ray) continue;
    const Eigen::Vector3d x2 = pose * Eigen::Vector3d(rng.Uniform(2.0, 6.0) * lens1.focal_px /
                                                      kWidth * ray->homogeneous());
    if (!(x2.z() > 0.1)) continue;
    const Eigen::Vector2d pixel2 = camera2.ImgFromCam(x2.hnormalized());
    const auto back = camera2.CamFromImg(pixel2);  // the fold shows nothing
    if (!in_image(pixel2) || !back || !back->isApprox(x2.hnormalized(), 1e-6)) continue;
    pair.pixels1.push_back(noisy(pixel));
    pair.pixels2.push_back(noisy(pixel2));
  }
  for (int i = 0; i < options.num_wrong; ++i) {
    pair.pixels1.push_back(UniformVector({{0, kWidth}, {0, kHeight}}, rng));
    pair.pixels2.push_back(UniformVector({{0, kWidth}, {0, kHeight}}, rng));
  }
  pair.F = EssentialFromPose(pose);
  // By the focal lengths that are nominal: 1.2 widths.
  const auto scaled = [](const Lens& lens) {
    return Eigen::Vector3d(1.2 * kWidth / lens.focal_px, 1.2 * kWidth / lens.focal_px, 1);
  };
  pair.F = scaled(lens2).asDiagonal() * pair.F * scaled(lens1).asDiagonal();
  return pair;
}

std::map<camera_t, Camera> Guesses(int num_cameras) {
  std::map<camera_t, Camera> cameras;
  for (camera_t id = 1; static_cast<int>(id) <= num_cameras; ++id) {
    cameras[id] = MakeCamera(id, 1.2 * kWidth, 0);
  }
  return cameras;
}

// The lens at the focal length of the guess.
double Nominal(const Lens& lens) { return lens.k * std::pow(1.2 * kWidth / lens.focal_px, 2); }

CalibratedDistortion OfOneCamera(const Lens& lens, uint64_t seed, const PairOptions& options = {}) {
  std::vector<DistortionPair> pairs;
  for (uint64_t i = 0; i < 8; ++i) {
    pairs.push_back(MakePair(1, lens, 1, lens, 100 * seed + i, options));
  }
  return CalibrateDistortion(Guesses(1), {}, {}, pairs, {.num_threads = 1}).cameras.at(1);
}

TEST(DistortionCalibration, FindsTheLensWhateverItsFocalLength) {
  for (const Lens& lens : {Lens{1000, -0.05}, Lens{1000, 0.05}, Lens{1000, -0.3}, Lens{700, -0.1},
                           Lens{700, 0.3}, Lens{2000, -0.3}, Lens{400, 0.2}, Lens{500, -0.1}}) {
    for (uint64_t seed = 1; seed <= 3; ++seed) {
      const CalibratedDistortion found = OfOneCamera(lens, seed);
      EXPECT_TRUE(found.is_significant) << lens.focal_px << " " << lens.k;
      EXPECT_NEAR(found.k / Nominal(lens), 1.0, 0.15) << lens.focal_px << " " << lens.k;
      EXPECT_LT(std::abs(found.k - Nominal(lens)), 4.5 * found.sigma) << lens.focal_px << lens.k;
      EXPECT_GT(found.num_matches, 1000);
      EXPECT_EQ(found.num_pairs, 8);
    }
  }
}

TEST(DistortionCalibration, ALensWithoutDistortionKeepsNone) {
  int num_taken = 0;
  double squares = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const CalibratedDistortion found = OfOneCamera({1000, 0}, seed);
    num_taken += found.is_significant;
    squares += std::pow(found.k / found.sigma, 2);
  }
  EXPECT_LE(num_taken, 1);
  EXPECT_LT(squares, 50);  // standard deviations are what they say
  EXPECT_GT(squares, 4);
}

// Straight ahead, distortion moves every point along its epipolar line.
TEST(DistortionCalibration, ForwardMotionTellsNothing) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const CalibratedDistortion found = OfOneCamera({1000, -0.1}, seed, {.is_forward = true});
    EXPECT_TRUE(!found.is_significant ||
                std::abs(found.k - Nominal({1000, -0.1})) < 4 * found.sigma);
  }
}

TEST(DistortionCalibration, CamerasOfDifferentLensesAreToldApart) {
  const std::vector<Lens> lenses = {{1000, -0.1}, {900, 0.0}, {1300, 0.08}};
  std::vector<DistortionPair> pairs;
  uint64_t seed = 0;
  for (camera_t a = 1; a <= 3; ++a) {
    for (camera_t b = 1; b <= 3; ++b) {
      for (int i = 0; i < 3; ++i) {
        pairs.push_back(MakePair(a, lenses[a - 1], b, lenses[b - 1], ++seed));
      }
    }
  }
  const auto report = CalibrateDistortion(Guesses(3), {}, {}, pairs, {.num_threads = 1});
  for (camera_t id = 1; id <= 3; ++id) {
    const CalibratedDistortion& found = report.cameras.at(id);
    EXPECT_LT(std::abs(found.k - Nominal(lenses[id - 1])), 4 * found.sigma) << id;
    EXPECT_EQ(found.is_significant, id != 2) << id;
    EXPECT_LT(found.sigma, 0.03);
  }
  // One that is held says what it is, and nothing is sought of it.
  auto cameras = Guesses(3);
  cameras[1] = MakeCamera(1, 1.2 * kWidth, Nominal(lenses[0]));
  const auto held = CalibrateDistortion(cameras, {1}, {}, pairs, {.num_threads = 1});
  EXPECT_EQ(held.cameras.count(1), 0u);
  EXPECT_LT(std::abs(held.cameras.at(3).k - Nominal(lenses[2])), 4 * held.cameras.at(3).sigma);
}

// Three cameras of one pair each have too few to tell, and enough together.
TEST(DistortionCalibration, CamerasOfOneLensAreJudgedTogether) {
  const Lens lens = {1000, -0.1};
  std::vector<DistortionPair> pairs;
  for (camera_t id = 1; id <= 3; ++id) pairs.push_back(MakePair(id, lens, id, lens, id));
  const auto find = [&](const SharedLenses& shared) {
    return CalibrateDistortion(Guesses(3), {}, shared, pairs, {.num_threads = 1}).cameras;
  };
  for (const auto& [id, alone] : find({})) EXPECT_FALSE(alone.is_significant);
  const auto together = find({{1, 1}, {2, 1}, {3, 1}});
  ASSERT_EQ(together.size(), 3u);
  for (const auto& [id, camera] : together) {
    EXPECT_TRUE(camera.is_significant);
    EXPECT_EQ(camera.num_pairs, 3);
    EXPECT_LT(std::abs(camera.k - Nominal(lens)), 4 * camera.sigma);
  }
}

// A shutter that rolls bends each pair otherwise. What the pairs have in common is found all the
// same: their scatter says how sure it is, and is not counted as a systematic error, too.
TEST(DistortionCalibration, PairsThatScatterHaveALensInCommon) {
  std::vector<DistortionPair> pairs;
  for (int i = 0; i < 40; ++i) {
    const Lens lens = {1000, 0.025 + (i % 2 == 0 ? 0.025 : -0.025)};
    pairs.push_back(MakePair(1, lens, 1, lens, 900 + i));
  }
  const auto found = CalibrateDistortion(Guesses(1), {}, {}, pairs, {.num_threads = 1}).cameras;
  EXPECT_TRUE(found.at(1).is_significant) << found.at(1).gain << " " << found.at(1).cost;
  EXPECT_LT(std::abs(found.at(1).k - Nominal({1000, 0.025})), 4 * found.at(1).sigma);
}

TEST(DistortionCalibration, TwoPairsAreTooFew) {
  const Lens lens = {1000, -0.1};
  const std::vector<DistortionPair> pairs = {MakePair(1, lens, 1, lens, 1),
                                             MakePair(1, lens, 1, lens, 2)};
  EXPECT_FALSE(CalibrateDistortion(Guesses(1), {}, {}, pairs, {.num_threads = 1})
                   .cameras.at(1)
                   .is_significant);
  EXPECT_TRUE(CalibrateDistortion(Guesses(1), {}, {}, {}, {.num_threads = 1}).cameras.empty());
}

TEST(DistortionCalibration, IsOfCamerasThatCanHaveIt) {
  EXPECT_TRUE(CanCalibrateDistortion(MakeCamera(1, 1000, 0)));
  EXPECT_FALSE(CanCalibrateDistortion(MakeCamera(1, 1000, 0.01)));
  EXPECT_FALSE(CanCalibrateDistortion(
      Camera::FromFocal(1, CameraModel::kSimplePinhole, 1000, kWidth, kHeight)));
}

// The focal length of a distorted lens, from what the pairs are without the distortion.
TEST(DistortionCalibration, FocalLengthsFollowFromTheUndistortedPairs) {
  const Lens lens = {800, -0.12};
  std::vector<DistortionPair> pairs;
  for (uint64_t i = 1; i <= 20; ++i) pairs.push_back(MakePair(1, lens, 1, lens, i));
  const auto report = CalibrateDistortion(Guesses(1), {}, {}, pairs, {.num_threads = 1});
  EXPECT_EQ(report.pairs.size(), 20u);
  const CalibratedFocal with = CalibrateFocals(Guesses(1), {}, report.pairs).cameras.at(1);
  EXPECT_EQ(with.status, FocalStatus::kCalibrated);
  EXPECT_NEAR(with.focal_px, 800, std::max(30.0, 3 * with.sigma * 800));
}

TEST(DistortionCalibration, DoesNotDependOnThreads) {
  std::vector<DistortionPair> pairs;
  for (uint64_t i = 1; i <= 9; ++i)
    pairs.push_back(MakePair(1 + i % 2, {1000, -0.1}, 1, {1000, -0.1}, i));
  const auto one = CalibrateDistortion(Guesses(2), {}, {}, pairs, {.num_threads = 1});
  const auto four = CalibrateDistortion(Guesses(2), {}, {}, pairs, {.num_threads = 4});
  ASSERT_EQ(one.cameras.size(), 2u);
  for (const auto& [id, camera] : one.cameras) {
    EXPECT_EQ(camera.k, four.cameras.at(id).k);
    EXPECT_EQ(camera.sigma, four.cameras.at(id).sigma);
    EXPECT_EQ(camera.gain, four.cameras.at(id).gain);
  }
}

// The reduced gradient is what the cost does when k changes and F follows.
TEST(DistortedPair, ReducedGradientIsThatOfTheCost) {
  const DistortionPair pair =
      MakePair(1, {1000, -0.1}, 2, {1100, 0.05}, 5, {.num_wrong = 0, .noise_px = 0.2});
  internal::DistortedPair distorted(pair, Guesses(2).at(1), Guesses(2).at(2));
  FundamentalFactors F = *FundamentalFactors::Of(pair.F);
  const double k[2] = {Nominal({1000, -0.1}) + 0.03, Nominal({1100, 0.05}) - 0.02};
  constexpr double kScalePx = 2.0, kStep = 1e-3;
  const auto cost = [&](double k1, double k2) {
    FundamentalFactors moved = F;
    distorted.SetDistortion(k1, k2);
    return distorted.Refine(kScalePx, 200, &moved);
  };
  distorted.SetDistortion(k[0], k[1]);
  distorted.Refine(kScalePx, 200, &F);
  const auto reduced = distorted.Reduce(F, kScalePx);
  const double by_k1 = (cost(k[0] + kStep, k[1]) - cost(k[0] - kStep, k[1])) / (2 * kStep);
  const double by_k2 = (cost(k[0], k[1] + kStep) - cost(k[0], k[1] - kStep)) / (2 * kStep);
  // (The gradient is half of it.)
  EXPECT_NEAR(2 * reduced.gradient[0], by_k1, 0.01 * std::abs(by_k1));
  EXPECT_NEAR(2 * reduced.gradient[1], by_k2, 0.01 * std::abs(by_k2));
}

}  // namespace
}  // namespace cairn
