#include "cairn/two_view/depth_evidence.h"

#include <gtest/gtest.h>

#include <cmath>

#include "cairn/base/error.h"
#include "two_view/pair_fixture.h"

namespace cairn::test {
namespace {

DepthEvidence Collect(const Pair& pair, const std::vector<std::vector<DepthSample>>& scales1,
                      const std::vector<std::vector<DepthSample>>& scales2) {
  FeatureMatches inliers;
  for (size_t i = 0; i < pair.matches.size(); ++i) {
    if (pair.is_inlier[i]) inliers.push_back(pair.matches[i]);
  }
  return CollectDepthEvidence({&pair.camera1, pair.keypoints1, scales1},
                              {&pair.camera2, pair.keypoints2, scales2}, inliers,
                              pair.cam2_from_cam1);
}

// The samples with gradients that mean nothing.
std::vector<DepthSample> WithoutGradient(std::vector<DepthSample> samples, uint64_t seed) {
  Rng rng(seed, "gradient");
  for (DepthSample& sample : samples) {
    sample.ddepth_dx = static_cast<float>(0.05 * rng.Gaussian());
    sample.ddepth_dy = static_cast<float>(0.05 * rng.Gaussian());
  }
  return samples;
}

std::vector<DepthSample> Shifted(std::vector<DepthSample> samples, double shift) {
  for (DepthSample& sample : samples) sample = ShiftInverseDepth(sample, shift);
  return samples;
}

double MeanInverse(const std::vector<DepthSample>& samples) {
  double sum = 0.0;
  for (const DepthSample& sample : samples) sum += 1.0 / sample.depth;
  return sum / static_cast<double>(samples.size());
}

TEST(DepthEvidence, CountsRightHypothesesOfEveryScale) {
  const Pair pair = MakePair({.depth_noise = 0.0}, 1);
  const DepthEvidence evidence =
      Collect(pair, {pair.depth1, WithoutGradient(pair.depth1, 1)},
              {WithoutGradient(pair.depth2, 2), pair.depth2, pair.depth2});
  EXPECT_EQ(evidence.num_readings1, 4);
  EXPECT_EQ(evidence.num_readings2, 6);
  EXPECT_EQ(evidence.num_samples, 40);
  EXPECT_GE(evidence.NumRight(0, 1), 37);
  EXPECT_EQ(evidence.NumRight(0, 1), evidence.NumRight(0, 2));
  EXPECT_LT(evidence.NumRight(0, 0), 20);
  EXPECT_LT(evidence.NumRight(1, 1), 20);
  EXPECT_LT(evidence.NumRight(1, 0), 15);
}

TEST(DepthEvidence, ExactDepthHasNoShift) {
  const Pair pair = MakePair({.noise_px = 0.1, .depth_noise = 0.0}, 2);
  const DepthEvidence evidence = Collect(pair, {pair.depth1}, {pair.depth2});
  EXPECT_LT(std::abs(evidence.shift1.value), 3 * evidence.shift1.sigma);
  EXPECT_LT(evidence.shift1.sigma, 0.05 * MeanInverse(pair.depth1));
  EXPECT_EQ(evidence.NumRight(1, 1), evidence.NumRight(0, 0));
}

TEST(DepthEvidence, FindsTheShiftOfInverseDepth) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Pair pair = MakePair({.noise_px = 0.2, .depth_noise = 0.02}, seed);
    const double shift1 = 0.3 * MeanInverse(pair.depth1);
    const double shift2 = -0.3 * MeanInverse(pair.depth2);
    const DepthEvidence evidence =
        Collect(pair, {Shifted(pair.depth1, -shift1)}, {Shifted(pair.depth2, -shift2)});
    EXPECT_NEAR(evidence.shift1.value, shift1, 5 * evidence.shift1.sigma) << seed;
    EXPECT_NEAR(evidence.shift2.value, shift2, 5 * evidence.shift2.sigma) << seed;
    EXPECT_NEAR(evidence.shift1.value, shift1, 0.5 * shift1) << seed;
    EXPECT_GT(evidence.NumRight(1, 1), 25) << seed;
    EXPECT_GT(evidence.NumRight(1, 1), evidence.NumRight(0, 0)) << seed;
  }
}

TEST(DepthEvidence, DepthThatMeansNothingHasNoShift) {
  Pair pair = MakePair({}, 3);
  Rng rng(3, "depth");
  for (DepthSample& sample : pair.depth1) {
    sample.depth = static_cast<float>(2.0 + 0.3 * rng.Gaussian());
  }
  const DepthEvidence evidence = Collect(pair, {pair.depth1}, {pair.depth2});
  EXPECT_TRUE(std::isinf(evidence.shift1.sigma));
  EXPECT_TRUE(std::isfinite(evidence.shift2.sigma));
}

TEST(DepthEvidence, SwappedImagesSayTheSame) {
  const Pair pair = MakePair({.noise_px = 0.1}, 4);
  const Pair swapped = pair.Swapped();
  const auto shifted = Shifted(pair.depth1, -0.1);
  const DepthEvidence a = Collect(pair, {shifted}, {pair.depth2});
  const DepthEvidence b = Collect(swapped, {pair.depth2}, {shifted});
  EXPECT_NEAR(a.shift1.value, b.shift2.value, 1e-3);
  EXPECT_NEAR(a.NumRight(1, 0), b.NumRight(0, 1), 2);
}

TEST(DepthEvidence, WrongInputsAreBugsAndNothingIsNothing) {
  const Pair pair = MakePair({}, 5);
  EXPECT_THROW(Collect(pair, {}, {pair.depth2}), BugError);
  const std::vector<DepthSample> missing(pair.keypoints1.size());
  const DepthEvidence evidence = Collect(pair, {missing}, {pair.depth2});
  EXPECT_EQ(evidence.num_samples, 0);
  EXPECT_EQ(evidence.NumRight(1, 1), 0);
}

}  // namespace
}  // namespace cairn::test
