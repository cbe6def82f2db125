// One pair of images, 4096 x 4096 descriptors, one thread: ours, ours with polarities (half of the
// features are bright), and OpenCV's brute force, all with ratio test and cross-check.
// build/bench/matching_bench
#include <benchmark/benchmark.h>

#include <opencv2/features2d.hpp>
#include <vector>

#include "cairn/base/rng.h"
#include "cairn/matching/matching.h"

namespace cairn {
namespace {

constexpr int kNum = 4096;

// Half of the second image's descriptors are noisy ones of the first.
Descriptors MakeDescriptors(uint64_t seed, const Descriptors* first) {
  Rng rng(seed);
  Descriptors descriptors(kNum, 128);
  for (int i = 0; i < kNum; ++i) {
    const bool is_copy = first != nullptr && i % 2 == 0;
    for (int k = 0; k < 128; ++k) {
      const int value = is_copy ? (*first)(i, k) + static_cast<int>(rng.UniformInt(7)) - 3
                                : static_cast<int>(rng.UniformInt(100));
      descriptors(i, k) = static_cast<uint8_t>(std::clamp(value, 0, 255));
    }
  }
  return descriptors;
}

void Match(benchmark::State& state, const Polarities& polarities) {
  const Descriptors a = MakeDescriptors(1, nullptr), b = MakeDescriptors(2, &a);
  MatchingOptions options;
  options.max_distance = 2.0;
  size_t num_matches = 0;
  for (auto _ : state) {
    num_matches = MatchDescriptors({a, polarities}, {b, polarities}, options).size();
  }
  state.counters["matches"] = static_cast<double>(num_matches);
}

void Cairn(benchmark::State& state) { Match(state, {}); }
BENCHMARK(Cairn)->Unit(benchmark::kMillisecond);

void CairnWithPolarities(benchmark::State& state) {
  Rng rng(3);
  Polarities polarities(kNum);
  for (uint8_t& polarity : polarities) polarity = static_cast<uint8_t>(rng.UniformInt(2));
  Match(state, polarities);
}
BENCHMARK(CairnWithPolarities)->Unit(benchmark::kMillisecond);

void OpenCv(benchmark::State& state) {
  cv::setNumThreads(1);
  const Descriptors first = MakeDescriptors(1, nullptr), second = MakeDescriptors(2, &first);
  cv::Mat a(kNum, 128, CV_32F), b(kNum, 128, CV_32F);
  for (int i = 0; i < kNum; ++i) {
    for (int k = 0; k < 128; ++k) {
      a.at<float>(i, k) = first(i, k);
      b.at<float>(i, k) = second(i, k);
    }
  }
  const cv::BFMatcher matcher(cv::NORM_L2);
  std::vector<std::vector<cv::DMatch>> forward, backward;
  int num_matches = 0;
  for (auto _ : state) {
    matcher.knnMatch(a, b, forward, 2);
    matcher.knnMatch(b, a, backward, 2);
    num_matches = 0;
    for (const auto& best : forward) {
      const auto& back = backward[best[0].trainIdx];
      num_matches += best[0].distance < 0.8F * best[1].distance &&
                     back[0].trainIdx == best[0].queryIdx &&
                     back[0].distance < 0.8F * back[1].distance;
    }
  }
  state.counters["matches"] = num_matches;
}
BENCHMARK(OpenCv)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cairn
