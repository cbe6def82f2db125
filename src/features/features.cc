#include "cairn/features/features.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <tuple>

#include "cairn/base/check.h"
#include "features/extrema.h"
#include "features/patch.h"
#include "features/root_sift.h"

namespace cairn {
namespace {

constexpr int kMinImageSize = 32;  // px
constexpr int kMaxAdaptations = 8;
constexpr double kMaxAnisotropy = 5.0;
constexpr double kAdapted = 1.05;  // gradients are as strong in every direction
constexpr int kSmoothings = 6;     // of the histogram of angles
constexpr float kMinPeak = 0.8f;   // of the highest (Lowe, section 5)

// A keypoint that is not described yet. M's columns are its axes in pixels of the image.
struct Frame {
  Eigen::Vector2d center;  // in the octave's pixels
  double sigma = 0;        // where it was detected, in pixels of the image
  double response = 0;
  Eigen::Matrix2d M;
};

bool LargerFirst(const Frame& a, const Frame& b) {
  const auto key = [](const Frame& f) {
    return std::tuple(-f.sigma, -f.response, f.center.y(), f.center.x());
  };
  return key(a) < key(b);
}

// Lengths of the axes of the ellipse that M makes of the unit circle, the shorter first.
Eigen::Vector2d Axes(const Eigen::Matrix2d& M) {
  const double sum = std::sqrt(M.squaredNorm() + 2 * std::abs(M.determinant()));
  const double difference =
      std::sqrt(std::max(0.0, M.squaredNorm() - 2 * std::abs(M.determinant())));
  return {0.5 * (sum - difference), 0.5 * (sum + difference)};
}

// The gradient around a frame, from the level below the one whose blur is the frame's shorter axis:
// the grid adds some blur of its own.
PatchGradient GradientAround(const Octave& octave, const Eigen::Vector2d& center,
                             const Eigen::Matrix2d& M) {
  const double level = Octave::kLevels * std::log2(Axes(M)[0] / octave.Sigma(0)) - 1;
  const int nearest = std::clamp(static_cast<int>(std::lround(level)), 0, Octave::kLevels + 2);
  return SampleGradient(octave.levels[nearest], center, M / octave.pixel_size);
}

// M times the rotation that turns its second axis down.
Eigen::Matrix2d Upright(const Eigen::Matrix2d& M) {
  const Eigen::Vector2d down = M.inverse().col(1).normalized();
  return M * (Eigen::Matrix2d() << down.y(), down.x(), -down.x(), down.y()).finished();
}

// Baumberg's iteration (CVPR 2000; Mikolajczyk and Schmid, IJCV 2004): the shape in whose frame the
// gradients are as strong in every direction; its shorter axis stays that of the detected circle.
// Nothing: an edge, or no gradients at all.
std::optional<Eigen::Matrix2d> AdaptShape(const Octave& octave, const Frame& frame) {
  Eigen::Matrix2d M = frame.M;
  for (int i = 0; i < kMaxAdaptations; ++i) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> moments(
        SecondMoments(GradientAround(octave, frame.center, M)));
    const Eigen::Vector2d strengths = moments.eigenvalues().cwiseMax(0).cwiseSqrt();
    if (strengths[1] >= kMaxAnisotropy * strengths[0]) return std::nullopt;
    M *= moments.operatorInverseSqrt();
    const Eigen::Vector2d axes = Axes(M);
    if (axes[1] > kMaxAnisotropy * axes[0]) return std::nullopt;
    M *= frame.sigma / axes[0];
    if (strengths[1] < kAdapted * strengths[0]) break;
  }
  return Upright(M);
}

// The directions of a frame's strongest gradients, at most max_number (Lowe, section 5).
std::vector<double> DominantAngles(const PatchGradient& gradient, int max_number) {
  std::array<float, kNumAngles> histogram = AngleHistogram(gradient);
  for (int round = 0; round < kSmoothings; ++round) {
    const auto raw = histogram;
    for (int i = 0; i < kNumAngles; ++i) {
      histogram[i] =
          (raw[(i + kNumAngles - 1) % kNumAngles] + raw[i] + raw[(i + 1) % kNumAngles]) / 3;
    }
  }
  const float least = kMinPeak * *std::max_element(histogram.begin(), histogram.end());
  std::vector<std::pair<float, double>> peaks;  // minus the height, angle
  for (int i = 0; i < kNumAngles; ++i) {
    const float before = histogram[(i + kNumAngles - 1) % kNumAngles], here = histogram[i];
    const float after = histogram[(i + 1) % kNumAngles];
    if (here < least || here <= before || here < after) continue;
    const double offset = 0.5 * (before - after) / (before - 2 * here + after);
    peaks.emplace_back(-here, (i + offset) * 2 * std::numbers::pi / kNumAngles);
  }
  std::sort(peaks.begin(), peaks.end());
  peaks.resize(std::min(peaks.size(), static_cast<size_t>(max_number)));
  std::vector<double> angles;
  for (const auto& [height, angle] : peaks) angles.push_back(angle);
  return angles;
}

// The frames of an octave's extrema, the larger first, at most max_frames.
std::vector<Frame> FindFrames(const Octave& octave, const FeatureOptions& options,
                              size_t max_frames) {
  std::vector<Frame> detected, frames;
  for (const Extremum& extremum : FindExtrema(octave, options)) {
    const double sigma = octave.Sigma(extremum.level);
    detected.push_back({{extremum.x, extremum.y},
                        sigma,
                        std::abs(extremum.value),
                        sigma * Eigen::Matrix2d::Identity()});
  }
  std::sort(detected.begin(), detected.end(), LargerFirst);
  for (Frame& frame : detected) {
    if (frames.size() >= max_frames) break;
    if (options.type == FeatureType::kAffineDog) {
      const auto shape = AdaptShape(octave, frame);
      if (!shape) continue;
      frame.M = *shape;
    }
    if (options.estimate_upright) {
      frames.push_back(frame);
      continue;
    }
    const Eigen::Matrix2d M = frame.M;
    const PatchGradient gradient = GradientAround(octave, frame.center, M);
    for (const double angle : DominantAngles(gradient, options.max_num_orientations)) {
      frame.M = M * Eigen::Rotation2Dd(angle).toRotationMatrix();
      frames.push_back(frame);
    }
  }
  frames.resize(std::min(frames.size(), max_frames));
  return frames;
}

// Coarse octaves first: the finest are built only where these have too few features.
Features Extract(const Bitmap& gray, const FeatureOptions& options) {
  Features features;
  features.descriptors.resize(0, kSiftDim);
  if (std::min(gray.width, gray.height) < kMinImageSize) return features;
  ScaleSpace scale_space(gray);
  const auto max_num_features = static_cast<size_t>(options.max_num_features);
  for (int o = scale_space.last_octave(); o >= options.first_octave; --o) {
    const size_t begin = features.keypoints.size();
    if (begin >= max_num_features) break;
    const Octave octave = scale_space.Build(o);
    const std::vector<Frame> frames = FindFrames(octave, options, max_num_features - begin);
    features.descriptors.conservativeResize(begin + frames.size(), kSiftDim);
    for (size_t i = 0; i < frames.size(); ++i) {
      const Eigen::Vector2f center =
          (frames[i].center * octave.pixel_size).array().cast<float>() + 0.5f;
      const Eigen::Matrix2f M = frames[i].M.cast<float>();
      features.keypoints.push_back({center.x(), center.y(), M(0, 0), M(0, 1), M(1, 0), M(1, 1)});
      const auto histogram = SiftHistogram(GradientAround(octave, frames[i].center, frames[i].M));
      WriteRootSift(histogram.data(), features.descriptors.row(begin + i).data());
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
  cv::resize(source, target, target.size(), 0, 0, cv::INTER_AREA);
  return reduced;
}

// Callers have an image a thread; OpenCV would add its own to each. Once only: setNumThreads
// crashes while another thread is inside OpenCV.
void KeepOpenCvToTheCallersThread() {
  [[maybe_unused]] static const bool is_set = (cv::setNumThreads(1), true);
}

}  // namespace

Features ExtractFeatures(const Bitmap& gray, const FeatureOptions& options) {
  ValidateOptions(options, "features");
  CAIRN_CHECK_EQ(gray.channels, 1);
  CAIRN_CHECK_EQ(gray.data.size(), static_cast<size_t>(gray.width) * gray.height);
  KeepOpenCvToTheCallersThread();
  const int size = std::max(gray.width, gray.height);
  if (size <= options.max_image_size) return Extract(gray, options);

  const Bitmap reduced = Reduce(gray, static_cast<double>(options.max_image_size) / size);
  Features features = Extract(reduced, options);
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
