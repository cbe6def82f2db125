#include "cairn/features/features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "cairn/base/check.h"
#include "cairn/image/resample.h"
#include "features/frames.h"

namespace cairn {
namespace {

constexpr int kMinImageSize = 32;  // px

// RootSIFT (Arandjelovic and Zisserman 2012): divided by its sum, and square roots, so that the
// result has unit Euclidean length; stored as min(255, round(512 x)), as COLMAP does. A zero
// histogram stays zero.
void WriteRootSift(const std::array<float, kDescriptorSize>& histogram, uint8_t* descriptor) {
  const Eigen::Map<const Eigen::Array<float, kDescriptorSize, 1>> values(histogram.data());
  const float sum = std::max(values.sum(), 1e-12f);
  Eigen::Map<Eigen::Array<uint8_t, kDescriptorSize, 1>>(descriptor, kDescriptorSize) =
      (512 * (values / sum).sqrt()).round().min(255).cast<uint8_t>();
}

struct SearchedOctave {
  SearchedOctave(const ScaleSpace& scale_space, int octave_, const FeatureOptions& options)
      : octave(scale_space.Build(octave_)), extrema(FindExtrema(octave, options)) {}

  Octave octave;
  std::vector<Extremum> extrema;
};

// What extrema must reach: peak_threshold, or where fewer than min_num_extrema reach that, what as
// many do. Coarse octaves first, which tell in most images; `searched` gets those that it took,
// with all extrema that may count.
double LeastResponse(const ScaleSpace& scale_space, const FeatureOptions& options,
                     const Masked& is_masked, std::vector<SearchedOctave>& searched) {
  FeatureOptions weak = options;
  weak.peak_threshold = std::min(options.min_peak_threshold, options.peak_threshold);
  const int wanted = options.min_num_extrema;
  std::vector<double> below;
  int num_above = 0;
  for (int o = scale_space.last_octave(); o >= options.first_octave && num_above < wanted; --o) {
    const auto& [octave, extrema] = searched.emplace_back(scale_space, o, weak);
    for (const Extremum& extremum : extrema) {
      if (is_masked(octave.pixel_size * Eigen::Vector2d(extremum.x, extremum.y))) continue;
      const double response = std::abs(extremum.value);
      if (response >= options.peak_threshold) {
        ++num_above;
      } else {
        below.push_back(response);
      }
    }
  }
  if (num_above >= wanted) return options.peak_threshold;
  const int num_more = wanted - num_above;
  if (std::ssize(below) <= num_more) return weak.peak_threshold;
  std::nth_element(below.begin(), below.begin() + num_more - 1, below.end(), std::greater<>());
  return below[num_more - 1];
}

// Coarse octaves first: the finest are built only where these have too few features.
Features Extract(const Bitmap& gray, FeatureOptions options, const Bitmap* mask) {
  Features features;
  features.descriptors.resize(0, kDescriptorSize);
  if (std::min(gray.width, gray.height) < kMinImageSize) return features;
  // (Kernels count pixels by 32 bits.)
  const bool can_double = 4.0 * gray.width * gray.height < std::numeric_limits<int32_t>::max();
  if (!can_double) options.first_octave = std::max(0, options.first_octave);
  Masked is_masked{mask};
  if (mask != nullptr) {
    is_masked.scale_x = static_cast<double>(mask->width) / gray.width;
    is_masked.scale_y = static_cast<double>(mask->height) / gray.height;
  }
  const ScaleSpace scale_space(gray);
  std::vector<SearchedOctave> searched;
  options.peak_threshold = LeastResponse(scale_space, options, is_masked, searched);
  const auto max_num_features = static_cast<size_t>(options.max_num_features);
  for (int o = scale_space.last_octave(); o >= options.first_octave; --o) {
    const size_t begin = features.keypoints.size();
    if (begin >= max_num_features) break;
    const auto at = static_cast<size_t>(scale_space.last_octave() - o);
    if (at == searched.size()) searched.emplace_back(scale_space, o, options);
    const auto [octave, extrema] = std::move(searched[at]);
    const std::vector<Frame> frames =
        FindFrames(octave, extrema, options, is_masked, max_num_features - begin);
    features.descriptors.conservativeResize(begin + frames.size(), kDescriptorSize);
    for (size_t i = 0; i < frames.size(); ++i) {
      const Eigen::Vector2f center =
          (frames[i].center * octave.pixel_size).array().cast<float>() + 0.5f;
      const Eigen::Matrix2f M = frames[i].M.cast<float>();
      features.keypoints.push_back({center.x(), center.y(), M(0, 0), M(0, 1), M(1, 0), M(1, 1)});
      features.polarities.push_back(frames[i].is_bright);
      const auto histogram = SiftHistogram(GradientAround(octave, frames[i].center, frames[i].M));
      WriteRootSift(histogram, features.descriptors.row(begin + i).data());
    }
  }
  return features;
}

}  // namespace

Features ExtractFeatures(const Bitmap& gray, const FeatureOptions& options, const Bitmap* mask) {
  ValidateOptions(options, "features");
  CAIRN_CHECK_EQ(gray.channels, 1);
  CAIRN_CHECK_EQ(gray.data.size(), static_cast<size_t>(gray.width) * gray.height);
  if (mask != nullptr) {
    CAIRN_CHECK_EQ(mask->channels, 1);
    CAIRN_CHECK_EQ(mask->width, gray.width);
    CAIRN_CHECK_EQ(mask->height, gray.height);
  }
  const int size = std::max(gray.width, gray.height);
  if (size <= options.max_image_size) return Extract(gray, options, mask);

  const double scale = static_cast<double>(options.max_image_size) / size;
  const auto reduced_side = [&](int side) {
    return std::max(1, static_cast<int>(std::lround(side * scale)));
  };
  const Bitmap reduced = ReducedBitmap(gray, reduced_side(gray.width), reduced_side(gray.height));
  Features features = Extract(reduced, options, mask);
  const float scale_x = static_cast<float>(gray.width) / reduced.width;
  const float scale_y = static_cast<float>(gray.height) / reduced.height;
  for (Keypoint& keypoint : features.keypoints) {
    keypoint.x *= scale_x;
    keypoint.a11 *= scale_x;
    keypoint.a12 *= scale_x;
    keypoint.y *= scale_y;
    keypoint.a21 *= scale_y;
    keypoint.a22 *= scale_y;
  }
  return features;
}

}  // namespace cairn
