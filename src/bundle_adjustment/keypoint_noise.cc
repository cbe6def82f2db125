#include "bundle_adjustment/keypoint_noise.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "cairn/base/parallel.h"
#include "scene/view_table.h"

namespace cairn {
namespace {

constexpr int kNumBins = 16;
constexpr size_t kMinObservationsPerBin = 30;
// With half as many, of two errors each, a bin's median is known to less than a percent.
constexpr size_t kMaxPoints = 200'000;
constexpr size_t kPointsATime = 1024;  // that one thread looks at
// Errors of an observation that alone decides where its point lies tell nothing.
constexpr double kMaxLeverage = 0.8;
// No detector is more exact than this; exact data would have no scale otherwise.
constexpr double kMinSigmaPx = 0.05;
// Median of a length whose two coordinates are standard normal.
constexpr double kRayleighMedian = 1.17741;
// And of one coordinate.
constexpr double kNormalMedian = 0.67449;

struct Sample {
  double scale;
  double error_px;  // as it would be if the point were known exactly
};

void AddSamples(const Point3D& point, const ViewTable& views, const KeypointScales& scales,
                std::vector<Sample>& samples) {
  const auto precision = [](const ViewTable::View& view, point2D_t k) {
    return 1.0 / (view.SigmaPx(k) * view.SigmaPx(k));
  };
  double total = 0;
  for (const TrackElement& element : point.track) {
    total += precision(views.Of(element.image_id), element.point2D);
  }
  for (const TrackElement& element : point.track) {
    const ViewTable::View& view = views.Of(element.image_id);
    const double error_px = view.ErrorPx(point.xyz, element.point2D);
    if (!std::isfinite(error_px)) continue;
    // The point's 3 coordinates adapt to the 2n coordinates of its errors, most to the precise
    // ones.
    const double leverage = 1.5 * precision(view, element.point2D) / total;
    if (leverage > kMaxLeverage) continue;
    // Errors of two views are along one line.
    const double dimension =
        point.track.size() == 2 ? kRayleighMedian / (std::sqrt(2.0) * kNormalMedian) : 1;
    samples.push_back({scales.at(element.image_id)[element.point2D],
                       dimension * error_px / std::sqrt(1.0 - leverage)});
  }
}

std::vector<Sample> CollectSamples(const Reconstruction& reconstruction,
                                   const KeypointScales& scales, int num_threads) {
  const size_t step = 1 + reconstruction.points3D.size() / kMaxPoints;
  std::vector<const Point3D*> points;
  size_t next = 0;
  for (const auto& [id, point] : reconstruction.points3D) {
    if (next++ % step == 0) points.push_back(&point);
  }
  const ViewTable views(reconstruction);
  std::vector<std::vector<Sample>> parts((points.size() + kPointsATime - 1) / kPointsATime);
  ParallelFor(num_threads, std::ssize(parts), [&](int64_t part) {
    const size_t end = std::min(points.size(), (part + 1) * kPointsATime);
    for (size_t i = part * kPointsATime; i < end; ++i) {
      AddSamples(*points[i], views, scales, parts[part]);
    }
  });
  std::vector<Sample> samples;
  for (const std::vector<Sample>& part : parts) {
    samples.insert(samples.end(), part.begin(), part.end());
  }
  return samples;
}

// Of one bin: its median scale and the standard deviation that the median error shows.
Sample Summarize(std::span<Sample> bin) {
  const auto middle = bin.begin() + static_cast<int64_t>(bin.size() / 2);
  std::ranges::nth_element(bin, middle, {}, &Sample::scale);
  const double scale = middle->scale;
  std::ranges::nth_element(bin, middle, {}, &Sample::error_px);
  return {scale, std::max(kMinSigmaPx, middle->error_px / kRayleighMedian)};
}

}  // namespace

double KeypointNoise::SigmaPx(double scale) const {
  return std::max(kMinSigmaPx, std::hypot(floor_px, per_scale * scale));
}

KeypointNoise EstimateKeypointNoise(const Reconstruction& reconstruction,
                                    const KeypointScales& scales, int num_threads) {
  std::vector<Sample> samples = CollectSamples(reconstruction, scales, num_threads);
  if (samples.size() < kNumBins * kMinObservationsPerBin) return {};
  std::ranges::sort(samples, {}, &Sample::scale);
  // Least squares in sigma^2 = x + y scale^2 with relative errors, x and y not negative.
  double s11 = 0, s12 = 0, s22 = 0, b1 = 0, b2 = 0;
  for (int bin = 0; bin < kNumBins; ++bin) {
    const size_t begin = samples.size() * bin / kNumBins;
    const size_t end = samples.size() * (bin + 1) / kNumBins;
    const auto [scale, sigma] = Summarize(std::span(samples).subspan(begin, end - begin));
    const double weight = 1.0 / (sigma * sigma);
    const double a1 = weight;
    const double a2 = weight * scale * scale;
    s11 += a1 * a1, s12 += a1 * a2, s22 += a2 * a2, b1 += a1, b2 += a2;
  }
  const double determinant = s11 * s22 - s12 * s12;
  double x = b1 / s11;
  double y = 0;
  if (determinant > 1e-9 * s11 * s22) {
    x = (s22 * b1 - s12 * b2) / determinant;
    y = (s11 * b2 - s12 * b1) / determinant;
    if (y < 0) x = b1 / s11, y = 0;
    if (x < 0) x = 0, y = b2 / s22;
  }
  return {std::sqrt(x), std::sqrt(y)};
}

}  // namespace cairn
