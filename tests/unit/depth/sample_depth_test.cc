#include "cairn/depth/sample_depth.h"

#include <cmath>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "support/test.h"

namespace cairn {
namespace {

constexpr int kImageWidth = 1500, kImageHeight = 800;
constexpr int kMapWidth = 60, kMapHeight = 80;  // 25 and 10 image pixels a map pixel

DepthOptions Windows(double value, double gradient) {
  return {.value_window = value, .gradient_window = gradient};
}

// value(x, y) over image pixels, sampled at the centers of the map's pixels.
template <class Function>
DepthMap MakeMap(int width, int height, Function value, const DepthOptions& options = {}) {
  std::vector<float> values;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      values.push_back(static_cast<float>(
          value((column + 0.5) * kImageWidth / width, (row + 0.5) * kImageHeight / height)));
    }
  }
  return DepthMapFromValues(width, height, values, options);
}

std::vector<Keypoint> RandomKeypoints(int n) {
  Rng rng(3, "keypoints");
  std::vector<Keypoint> keypoints(n);
  for (Keypoint& k : keypoints) {
    k.x = static_cast<float>(rng.Uniform(0.0, kImageWidth));
    k.y = static_cast<float>(rng.Uniform(0.0, kImageHeight));
  }
  // The corners, outside the outermost centers of the map.
  keypoints.push_back({.x = 0.5f, .y = 0.5f});
  keypoints.push_back({.x = kImageWidth - 0.5f, .y = kImageHeight - 0.5f});
  return keypoints;
}

double Plane(double x, double y) { return 5 + 0.002 * x - 0.003 * y; }

void ExpectPlane(const std::vector<Keypoint>& keypoints, const std::vector<DepthSample>& samples) {
  ASSERT_EQ(samples.size(), keypoints.size());
  for (size_t i = 0; i < samples.size(); ++i) {
    ASSERT_TRUE(samples[i].is_valid) << i;
    ASSERT_NEAR(samples[i].depth, Plane(keypoints[i].x, keypoints[i].y), 1e-4) << i;
    ASSERT_NEAR(samples[i].ddepth_dx, 0.002, 1e-6) << i;
    ASSERT_NEAR(samples[i].ddepth_dy, -0.003, 1e-6) << i;
  }
}

TEST(SampleDepth, PlaneIsExactForAnyWindowAndMapSize) {
  const std::vector<Keypoint> keypoints = RandomKeypoints(300);
  for (const auto& [width, height] :
       {std::pair{kMapWidth, kMapHeight}, {192, 128}, {15, 20}, {1500, 800}}) {
    const DepthMap map = MakeMap(width, height, Plane);
    for (const double window : {0.0, 0.003, 0.03, 0.2}) {
      for (const DepthOptions& windows : {Windows(window, 0.1), Windows(0.02, window)}) {
        ExpectPlane(keypoints, SampleDepth(map, kImageWidth, kImageHeight, keypoints, windows));
      }
    }
  }
}

TEST(SampleDepth, PlaneIsExactBesideMissingValues) {
  DepthMap map = MakeMap(kMapWidth, kMapHeight, Plane);
  Rng rng(5, "holes");
  for (size_t i = 0; i < map.is_valid.size(); ++i) {
    const bool stripe = i % kMapWidth > 20 && i % kMapWidth < 30;
    if (!stripe && rng.Uniform() > 0.3) continue;
    map.is_valid[i] = 0;
    map.values[i] = NAN;  // Must not be read.
  }
  const std::vector<Keypoint> keypoints = RandomKeypoints(500);
  const std::vector<DepthSample> samples =
      SampleDepth(map, kImageWidth, kImageHeight, keypoints, {});
  int num_missing = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    const int column = static_cast<int>(keypoints[i].x / 25),
              row = static_cast<int>(keypoints[i].y / 10);
    ASSERT_EQ(samples[i].is_valid, map.is_valid[row * kMapWidth + column] == 1) << i;
    num_missing += !samples[i].is_valid;
    if (samples[i].is_valid) ExpectPlane({keypoints[i]}, {samples[i]});
  }
  EXPECT_GT(num_missing, 100);
}

TEST(SampleDepth, EveryKindGivesTheSameDepth) {
  const auto smooth = [](double x, double y) { return 4 + 0.5 * std::sin(x / 300 + y / 500); };
  const std::vector<Keypoint> keypoints = RandomKeypoints(100);
  DepthOptions options;
  const DepthOptions windows = Windows(0.005, 0.005);
  const auto reference = SampleDepth(MakeMap(300, 160, smooth, options), kImageWidth, kImageHeight,
                                     keypoints, windows);
  options.kind = DepthKind::kInverse;
  const auto inverse =
      SampleDepth(MakeMap(
                      300, 160, [&](double x, double y) { return 1 / smooth(x, y); }, options),
                  kImageWidth, kImageHeight, keypoints, windows);
  options.kind = DepthKind::kLog;
  const auto log = SampleDepth(
      MakeMap(
          300, 160, [&](double x, double y) { return std::log(smooth(x, y)); }, options),
      kImageWidth, kImageHeight, keypoints, windows);
  for (size_t i = 0; i < keypoints.size(); ++i) {
    EXPECT_NEAR(reference[i].depth, smooth(keypoints[i].x, keypoints[i].y), 1e-3);
    for (const auto& other : {inverse[i], log[i]}) {
      EXPECT_NEAR(other.depth, reference[i].depth, 3e-4);
      EXPECT_NEAR(other.ddepth_dx, reference[i].ddepth_dx, 3e-5);
      EXPECT_NEAR(other.ddepth_dy, reference[i].ddepth_dy, 3e-5);
    }
  }
}

// Planes in space have a linear inverse depth.
TEST(SampleDepth, InverseDepthOfAPlaneIsExactForAnyWindow) {
  const auto inverse = [](double x, double y) { return 0.2 + 1e-4 * x - 2e-4 * y; };  // > 0.04
  const std::vector<Keypoint> keypoints = RandomKeypoints(300);
  DepthOptions options;
  options.kind = DepthKind::kInverse;
  // Below zero, an inverse depth is none.
  for (const double shift : {0.0, 0.1}) {
    const DepthMap map = MakeMap(
        kMapWidth, kMapHeight, [&](double x, double y) { return inverse(x, y) - shift; }, options);
    for (const DepthOptions& windows : {Windows(0.0, 0.003), Windows(0.02, 0.3)}) {
      const auto samples = SampleDepth(map, kImageWidth, kImageHeight, keypoints, windows);
      ASSERT_EQ(samples.size(), keypoints.size());
      for (size_t i = 0; i < samples.size(); ++i) {
        const double v = inverse(keypoints[i].x, keypoints[i].y) - shift;
        ASSERT_EQ(samples[i].is_valid, v > 0);
        if (v < 1e-3) continue;  // infinitely far
        ASSERT_NEAR(samples[i].depth * v, 1.0, 1e-3);
        ASSERT_NEAR(samples[i].ddepth_dx * v * v, -1e-4, 1e-6);
        ASSERT_NEAR(samples[i].ddepth_dy * v * v, 2e-4, 1e-6);
      }
    }
  }
}

TEST(SampleDepth, WindowsAreSharesOfTheImage) {
  DepthOptions options;
  options.gradient_window = 1.5;
  EXPECT_THROW(ValidateOptions(options, "depth"), ConfigError);
  options.gradient_window = 0.5;
  EXPECT_NO_THROW(ValidateOptions(options, "depth"));
}

TEST(SampleDepth, GradientIsTheDerivativeOfASmoothSurface) {
  const auto surface = [](double x, double y) { return 3 + std::sin(x / 400) + std::cos(y / 350); };
  const std::vector<Keypoint> keypoints = RandomKeypoints(200);
  const auto samples = SampleDepth(MakeMap(300, 200, surface), kImageWidth, kImageHeight, keypoints,
                                   Windows(0.004, 0.004));
  for (size_t i = 0; i < keypoints.size(); ++i) {
    EXPECT_NEAR(samples[i].ddepth_dx, std::cos(keypoints[i].x / 400) / 400, 1e-4);
    EXPECT_NEAR(samples[i].ddepth_dy, -std::sin(keypoints[i].y / 350) / 350, 1e-4);
  }
}

TEST(SampleDepth, EachWindowActsOnItsOwnResult) {
  Rng rng(11, "noise");
  const DepthMap map =
      MakeMap(kMapWidth, kMapHeight, [&](double, double) { return 5 + rng.Gaussian() * 0.3; });
  const std::vector<Keypoint> keypoints = RandomKeypoints(300);
  const auto spread = [&](double value_window, double gradient_window) {
    double value = 0, gradient = 0;
    for (const auto& s : SampleDepth(map, kImageWidth, kImageHeight, keypoints,
                                     Windows(value_window, gradient_window))) {
      value += std::abs(s.depth - 5);
      gradient += std::hypot(s.ddepth_dx, s.ddepth_dy);
    }
    return std::pair(value, gradient);
  };
  const auto narrow = spread(0.02, 0.02), wide_value = spread(0.1, 0.02),
             wide_gradient = spread(0.02, 0.1);
  EXPECT_LT(wide_value.first, 0.5 * narrow.first);
  EXPECT_EQ(wide_value.second, narrow.second);
  EXPECT_LT(wide_gradient.second, 0.2 * narrow.second);
  EXPECT_EQ(wide_gradient.first, narrow.first);
}

TEST(SampleDepth, PointsOutsideTheImageAreInvalid) {
  const DepthMap map = MakeMap(kMapWidth, kMapHeight, Plane);
  const std::vector<Keypoint> keypoints = {{.x = -1.f, .y = 5.f},
                                           {.x = 5.f, .y = kImageHeight + 1.f},
                                           {.x = NAN, .y = 5.f},
                                           {.x = 1e30f, .y = 5.f},
                                           {.x = 5.f, .y = 5.f}};
  const auto samples = SampleDepth(map, kImageWidth, kImageHeight, keypoints, {});
  EXPECT_FALSE(samples[0].is_valid || samples[1].is_valid || samples[2].is_valid ||
               samples[3].is_valid);
  EXPECT_TRUE(samples[4].is_valid);
}

TEST(SampleDepth, AMapThatFixesNoPlaneGivesNothing) {
  const std::vector<Keypoint> keypoints = RandomKeypoints(20);
  DepthMap map = MakeMap(kMapWidth, kMapHeight, Plane);
  std::fill(map.is_valid.begin(), map.is_valid.end(), 0);
  for (const auto& s : SampleDepth(map, kImageWidth, kImageHeight, keypoints, {})) {
    EXPECT_FALSE(s.is_valid);
  }
  for (int row = 0; row < kMapHeight; ++row) map.is_valid[row * kMapWidth + 7] = 1;  // a line
  const std::vector<Keypoint> on_line = {{.x = 7.5f * 25, .y = 100.f}};
  EXPECT_FALSE(SampleDepth(map, kImageWidth, kImageHeight, on_line, {})[0].is_valid);
}

TEST(SampleDepth, WrongSizesAreABug) {
  DepthMap map = MakeMap(kMapWidth, kMapHeight, Plane);
  EXPECT_THROW(SampleDepth(map, 0, 10, {}, {}), BugError);
  map.values.pop_back();
  EXPECT_THROW(SampleDepth(map, 10, 10, {}, {}), BugError);
  EXPECT_THROW(SampleDepth({}, 10, 10, {}, {}), BugError);
}

}  // namespace
}  // namespace cairn
