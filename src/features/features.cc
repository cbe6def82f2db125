#include "cairn/features/features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "cairn/base/check.h"
#include "features/frames.h"
#include "image/cv_decode.h"

namespace cairn {
namespace {

constexpr int kMinImageSize = 32;  // px

// RootSIFT (Arandjelovic and Zisserman 2012): divided by its sum, and square roots, so that the
// result has unit Euclidean length; stored as min(255, round(512 x)), as COLMAP does. A zero
// histogram stays zero.
void WriteRootSift(const std::array<float, kSiftDim>& histogram, uint8_t* descriptor) {
  const Eigen::Map<const Eigen::Array<float, kSiftDim, 1>> values(histogram.data());
  const float sum = std::max(values.sum(), 1e-12f);
  Eigen::Map<Eigen::Array<uint8_t, kSiftDim, 1>>(descriptor, kSiftDim) =
      (512 * (values / sum).sqrt()).round().min(255).cast<uint8_t>();
}

// Coarse octaves first: the finest are built only where these have too few features.
Features Extract(const Bitmap& gray, const FeatureOptions& options, const Bitmap* mask) {
  Features features;
  features.descriptors.resize(0, kSiftDim);
  if (std::min(gray.width, gray.height) < kMinImageSize) return features;
  Masked is_masked{mask};
  if (mask != nullptr) {
    is_masked.scale_x = static_cast<double>(mask->width) / gray.width;
    is_masked.scale_y = static_cast<double>(mask->height) / gray.height;
  }
  ScaleSpace scale_space(gray);
  const auto max_num_features = static_cast<size_t>(options.max_num_features);
  for (int o = scale_space.last_octave(); o >= options.first_octave; --o) {
    const size_t begin = features.keypoints.size();
    if (begin >= max_num_features) break;
    const Octave octave = scale_space.Build(o);
    const std::vector<Frame> frames =
        FindFrames(octave, options, is_masked, max_num_features - begin);
    features.descriptors.conservativeResize(begin + frames.size(), kSiftDim);
    for (size_t i = 0; i < frames.size(); ++i) {
      const Eigen::Vector2f center =
          (frames[i].center * octave.pixel_size).array().cast<float>() + 0.5f;
      const Eigen::Matrix2f M = frames[i].M.cast<float>();
      features.keypoints.push_back({center.x(), center.y(), M(0, 0), M(0, 1), M(1, 0), M(1, 1)});
      const auto histogram = SiftHistogram(GradientAround(octave, frames[i].center, frames[i].M));
      WriteRootSift(histogram, features.descriptors.row(begin + i).data());
    }
  }
  return features;
}

// Area averaging, so that nothing aliases and pixel areas map onto each other.
Bitmap Reduce(const Bitmap& gray, double scale) {
  Bitmap reduced;
  reduced.width = std::max(1, static_cast<int>(std::lround(gray.width * scale)));
  reduced.height = std::max(1, static_cast<int>(std::lround(gray.height * scale)));
  reduced.data.resize(static_cast<size_t>(reduced.width) * reduced.height);
  const cv::Mat source(gray.height, gray.width, CV_8UC1, const_cast<uint8_t*>(gray.data.data()));
  cv::Mat target(reduced.height, reduced.width, CV_8UC1, reduced.data.data());
  try {
    cv::resize(source, target, target.size(), 0, 0, cv::INTER_AREA);
  } catch (const cv::Exception& exception) {
    ThrowIfOutOfMemory(exception);
    throw;
  }
  return reduced;
}

// Callers have an image a thread; OpenCV would add its own to each. Once only: setNumThreads
// crashes while another thread is inside OpenCV.
void KeepOpenCvToTheCallersThread() {
  [[maybe_unused]] static const bool is_set = (cv::setNumThreads(1), true);
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
  KeepOpenCvToTheCallersThread();
  const int size = std::max(gray.width, gray.height);
  if (size <= options.max_image_size) return Extract(gray, options, mask);

  const Bitmap reduced = Reduce(gray, static_cast<double>(options.max_image_size) / size);
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
