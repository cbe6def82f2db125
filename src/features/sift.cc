#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <tuple>

#include "features/extractors.h"
#include "features/root_sift.h"

namespace cairn {
namespace {

// OpenCV keeps its pixels' centers at integers, and OpenCV 4.6's doubling of the image shifts by
// another quarter pixel: (x + 0.25) instead of (x + 0.5). Measured on blobs, see the test.
constexpr float kPixelShift = 0.25f;
constexpr int kLevelsPerOctave = 3;

// OpenCV's SIFT always begins at the doubled image; octave o of a keypoint, from its packed field.
int Octave(const cv::KeyPoint& keypoint) {
  const int octave = keypoint.octave & 255;
  return octave < 128 ? octave : octave - 256;
}

bool LargerKeyPointFirst(const cv::KeyPoint& a, const cv::KeyPoint& b) {
  return std::tuple(-a.size, -a.response, a.pt.y, a.pt.x, a.angle) <
         std::tuple(-b.size, -b.response, b.pt.y, b.pt.x, b.angle);
}

}  // namespace

Features ExtractSift(const Bitmap& gray, const FeatureOptions& options) {
  const cv::Mat image(gray.height, gray.width, CV_8UC1, const_cast<uint8_t*>(gray.data.data()));
  const auto sift = cv::SIFT::create(0, kLevelsPerOctave, options.peak_threshold * kLevelsPerOctave,
                                     options.edge_threshold, 1.6, CV_32F);
  std::vector<cv::KeyPoint> detected;
  sift->detect(image, detected);
  std::erase_if(detected, [&](const cv::KeyPoint& k) { return Octave(k) < options.first_octave; });
  std::sort(detected.begin(), detected.end(), LargerKeyPointFirst);
  detected.resize(std::min(detected.size(), static_cast<size_t>(options.max_num_features)));
  cv::Mat histograms;
  if (!detected.empty()) sift->compute(image, detected, histograms);

  Features features;
  features.descriptors.resize(detected.size(), kSiftDim);
  for (size_t i = 0; i < detected.size(); ++i) {
    const cv::KeyPoint& k = detected[i];
    features.keypoints.push_back(
        Keypoint::FromScaleOrientation(k.pt.x + kPixelShift, k.pt.y + kPixelShift, 0.5f * k.size,
                                       k.angle * std::numbers::pi_v<float> / 180));
    WriteRootSift(histograms.ptr<float>(static_cast<int>(i)), features.descriptors.row(i).data());
  }
  return features;
}

}  // namespace cairn
