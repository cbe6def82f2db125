#include "features/frames.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <tuple>

#include "cairn/math/decompositions.h"

namespace cairn {
namespace {

constexpr int kMaxAdaptations = 8;
constexpr double kMaxAnisotropy = 5.0;
constexpr double kAdapted = 1.05;  // gradients are as strong in every direction
constexpr int kSmoothings = 6;     // of the histogram of angles
constexpr float kMinPeak = 0.8f;   // of the highest (Lowe, section 5)

// Lengths of the axes of the ellipse that M makes of the unit circle, the shorter first.
Eigen::Vector2d Axes(const Eigen::Matrix2d& M) {
  const double sum = std::sqrt(M.squaredNorm() + 2 * std::abs(M.determinant()));
  const double difference =
      std::sqrt(std::max(0.0, M.squaredNorm() - 2 * std::abs(M.determinant())));
  return {0.5 * (sum - difference), 0.5 * (sum + difference)};
}

bool LargerFirst(const Frame& a, const Frame& b) {
  const auto key = [](const Frame& f) {
    return std::tuple(-f.sigma, -f.response, f.center.y(), f.center.x());
  };
  return key(a) < key(b);
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
    const auto [moments, directions] =
        SymmetricEigen(SecondMoments(GradientAround(octave, frame.center, M)));
    const Eigen::Vector2d strengths = moments.cwiseMax(0).cwiseSqrt();
    if (strengths[1] >= kMaxAnisotropy * strengths[0]) return std::nullopt;
    M *= directions * moments.cwiseInverse().cwiseSqrt().asDiagonal() * directions.transpose();
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

}  // namespace

PatchGradient GradientAround(const Octave& octave, const Eigen::Vector2d& center,
                             const Eigen::Matrix2d& M) {
  constexpr double kLast = Octave::kLevels + 2;
  const double level =
      std::clamp(Octave::kLevels * std::log2(Axes(M)[0] / octave.Sigma(0)) - 1, 0.0, kLast);
  const auto below = static_cast<size_t>(std::min(level, kLast - 1));
  return SampleGradient(octave.levels[below], octave.levels[below + 1],
                        level - static_cast<double>(below), center, M / octave.pixel_size);
}

bool Masked::operator()(const Eigen::Vector2d& pixel) const {
  if (mask == nullptr) return false;
  const auto at = [](double x, double scale, int size) {
    return std::clamp(static_cast<int>(std::floor((x + 0.5) * scale)), 0, size - 1);
  };
  return *mask->Pixel(at(pixel.x(), scale_x, mask->width), at(pixel.y(), scale_y, mask->height)) ==
         0;
}

std::vector<Frame> FindFrames(const Octave& octave, const std::vector<Extremum>& extrema,
                              const FeatureOptions& options, const Masked& is_masked,
                              size_t max_frames) {
  std::vector<Frame> detected, frames;
  for (const Extremum& extremum : extrema) {
    if (!extremum.Reaches(options.peak_threshold)) continue;
    const Eigen::Vector2d pixel(extremum.x, extremum.y);
    if (is_masked(octave.pixel_size * pixel)) continue;
    const double sigma = octave.Sigma(extremum.level);
    detected.push_back({{extremum.x, extremum.y},
                        sigma,
                        std::abs(extremum.value),
                        extremum.value < 0,
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

}  // namespace cairn
