#include "cairn/two_view/depth_evidence.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "cairn/base/check.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "cairn/solvers/one_affine_depth_batch.h"
#include "two_view/lifting.h"

namespace cairn {
namespace {

constexpr int kMaxSamples = 40;
constexpr int kMinSamplesOfLine = 15;
// A line whose slope, or a shift, is not this many standard deviations from zero says nothing.
constexpr double kMinSigmas = 3.0;
// No depth is truer than this share of the mean inverse depth.
constexpr double kMinRelativeSigma = 0.01;

// An inlier as one image has it.
struct View {
  const Keypoint* keypoint;
  point2D_t index;
  NormalizedFrame frame;
  double inverse_depth;  // triangulated, in units of the baseline
};

using Views = std::vector<View>;

bool HasDepth(const DepthSample& sample) { return sample.is_valid || sample.depth < 0; }

// z-depths of a match; false unless both are positive.
bool TriangulateDepths(const Eigen::Vector2d& x1, const Eigen::Vector2d& x2, const Rigid3d& pose,
                       double* depth1, double* depth2) {
  const Eigen::Vector3d ray1 = pose.rotation * x1.homogeneous(), ray2 = x2.homogeneous();
  const Eigen::Vector3d normal = ray1.cross(ray2);
  *depth1 = -pose.translation.cross(ray2).dot(normal) / normal.squaredNorm();
  *depth2 = (*depth1 * ray1 + pose.translation).z();
  return *depth1 > 0.0 && *depth2 > 0.0 && std::isfinite(*depth1);
}

// Up to kMaxSamples inliers that have depth in both images.
void ChooseSamples(const DepthWitness& image1, const DepthWitness& image2,
                   std::span<const FeatureMatch> inliers, const Rigid3d& pose, Views* views1,
                   Views* views2) {
  FeatureMatches with_depth;
  for (const FeatureMatch& match : inliers) {
    CAIRN_CHECK_LT(match.point1, image1.keypoints.size());
    CAIRN_CHECK_LT(match.point2, image2.keypoints.size());
    if (HasDepth(image1.scales[0][match.point1]) && HasDepth(image2.scales[0][match.point2])) {
      with_depth.push_back(match);
    }
  }
  const size_t step = std::max<size_t>(1, with_depth.size() / kMaxSamples);
  for (size_t i = 0; i < with_depth.size() && std::ssize(*views1) < kMaxSamples; i += step) {
    const auto [point1, point2] = with_depth[i];
    const Keypoint& keypoint1 = image1.keypoints[point1];
    const Keypoint& keypoint2 = image2.keypoints[point2];
    const auto x1 = image1.camera->CamFromImg(keypoint1.Position());
    const auto x2 = image2.camera->CamFromImg(keypoint2.Position());
    double depth1, depth2;
    if (!x1 || !x2 || !TriangulateDepths(*x1, *x2, pose, &depth1, &depth2)) continue;
    views1->push_back({&keypoint1, point1,
                       internal::NormalizeFrame(*image1.camera, keypoint1, x1->homogeneous()),
                       1.0 / depth1});
    views2->push_back({&keypoint2, point2,
                       internal::NormalizeFrame(*image2.camera, keypoint2, x2->homogeneous()),
                       1.0 / depth2});
  }
}

struct Line {
  double slope = 0.0, offset = 0.0;
  double slope_sigma = 0.0, offset_sigma = 0.0;
};

// y = slope x + offset by least absolute deviations (iteratively reweighted least squares).
Line FitLine(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  std::vector<double> weights(x.size(), 1.0), residuals(x.size());
  Line line;
  double mean_x = 0.0, spread_x = 0.0, median = 0.0;
  for (int iteration = 0; iteration < 10; ++iteration) {
    double sum = 0.0, sum_x = 0.0, sum_y = 0.0, sum_xx = 0.0, sum_xy = 0.0;
    for (size_t i = 0; i < x.size(); ++i) {
      sum += weights[i];
      sum_x += weights[i] * x[i];
      sum_y += weights[i] * y[i];
      sum_xx += weights[i] * x[i] * x[i];
      sum_xy += weights[i] * x[i] * y[i];
    }
    mean_x = sum_x / sum;
    spread_x = std::max(sum_xx / sum - mean_x * mean_x, 1e-12 * mean_x * mean_x);
    line.slope = (sum_xy / sum - mean_x * sum_y / sum) / spread_x;
    line.offset = sum_y / sum - line.slope * mean_x;
    for (size_t i = 0; i < x.size(); ++i) {
      residuals[i] = std::abs(y[i] - line.slope * x[i] - line.offset);
    }
    median = UpperMedian(residuals);
    for (size_t i = 0; i < x.size(); ++i) {
      weights[i] = 1.0 / std::max(residuals[i], 0.01 * median + 1e-300);
    }
  }
  // 1.25: least absolute deviations against least squares, on normal errors.
  const double sigma = 1.25 * 1.4826 * median / std::sqrt(n);
  line.slope_sigma = sigma / std::sqrt(spread_x);
  line.offset_sigma = sigma * std::sqrt(1.0 + mean_x * mean_x / spread_x);
  return line;
}

DepthEvidence::Shift FindShift(const std::vector<DepthSample>& samples, const Views& views) {
  if (std::ssize(views) < kMinSamplesOfLine) return {};
  std::vector<double> triangulated, sampled;
  double sum = 0.0;
  for (const View& view : views) {
    triangulated.push_back(view.inverse_depth);
    sampled.push_back(1.0 / samples[view.index].depth);
    sum += std::abs(sampled.back());
  }
  const Line line = FitLine(triangulated, sampled);
  if (!(line.slope > kMinSigmas * line.slope_sigma)) return {};
  const double least_sigma = kMinRelativeSigma * sum / static_cast<double>(views.size());
  return {-line.offset, std::max(line.offset_sigma, least_sigma)};
}

bool IsWorthTrying(const DepthEvidence::Shift& shift) {
  return std::abs(shift.value) > kMinSigmas * shift.sigma;  // never with an infinite sigma
}

// A reading of an image's depth: the lifted frames of all samples, all zero where there is none.
using Reading = std::vector<LiftedFrame>;

Reading ReadScale(const std::vector<DepthSample>& samples, const Views& views, double shift) {
  Reading reading;
  for (const View& view : views) {
    DepthSample sample = samples[view.index];
    if (shift != 0.0) sample = ShiftInverseDepth(sample, shift);
    reading.push_back(sample.is_valid ? internal::LiftNormalized(view.frame, *view.keypoint, sample)
                                      : LiftedFrame());
  }
  return reading;
}

// All readings; the shifted ones are empty where there is no shift to be tried.
std::vector<Reading> MakeReadings(const DepthWitness& image, const Views& views,
                                  const DepthEvidence::Shift& shift) {
  std::vector<Reading> readings;
  for (const auto& samples : image.scales) readings.push_back(ReadScale(samples, views, 0.0));
  for (const auto& samples : image.scales) {
    readings.push_back(IsWorthTrying(shift) ? ReadScale(samples, views, shift.value) : Reading());
  }
  return readings;
}

int CountRight(const Reading& reading1, const Reading& reading2, const Rigid3d& pose,
               OneAffineDepthBatch* batch) {
  const int n = static_cast<int>(reading1.size());
  batch->Reset(n);
  for (int i = 0; i < n; ++i) batch->Set(i, reading1[i], reading2[i]);
  batch->Solve();
  const double min_trace = 1.0 + 2.0 * std::cos(DegToRad(20.0));
  const double min_cosine = std::cos(DegToRad(15.0));
  const Eigen::Matrix3d expected = pose.RotationMatrix();
  const Eigen::Vector3d direction = pose.translation.normalized();
  int num_right = 0;
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  for (int i = 0; i < n; ++i) {
    num_right += batch->Get(i, &R, &t) && R.cwiseProduct(expected).sum() > min_trace &&
                 t.dot(direction) > min_cosine;
  }
  return num_right;
}

}  // namespace

DepthEvidence CollectDepthEvidence(const DepthWitness& image1, const DepthWitness& image2,
                                   std::span<const FeatureMatch> inliers,
                                   const Rigid3d& cam2_from_cam1) {
  CAIRN_CHECK(!image1.scales.empty() && !image2.scales.empty());
  const int num_scales1 = static_cast<int>(image1.scales.size());
  const int num_scales2 = static_cast<int>(image2.scales.size());
  Views views1, views2;
  ChooseSamples(image1, image2, inliers, cam2_from_cam1, &views1, &views2);
  DepthEvidence evidence;
  evidence.shift1 = FindShift(image1.scales[0], views1);
  evidence.shift2 = FindShift(image2.scales[0], views2);
  evidence.num_samples = static_cast<int>(views1.size());
  evidence.num_readings1 = 2 * num_scales1;
  evidence.num_readings2 = 2 * num_scales2;
  const std::vector<Reading> readings1 = MakeReadings(image1, views1, evidence.shift1);
  const std::vector<Reading> readings2 = MakeReadings(image2, views2, evidence.shift2);
  OneAffineDepthBatch batch;
  for (int k1 = 0; k1 < evidence.num_readings1; ++k1) {
    // A shift that is not worth trying changes nothing.
    const int same1 = readings1[k1].empty() && k1 >= num_scales1 ? k1 - num_scales1 : k1;
    for (int k2 = 0; k2 < evidence.num_readings2; ++k2) {
      const int same2 = readings2[k2].empty() && k2 >= num_scales2 ? k2 - num_scales2 : k2;
      const bool is_known = same1 < k1 || same2 < k2;
      evidence.num_right.push_back(
          is_known ? evidence.NumRight(same1, same2)
                   : CountRight(readings1[k1], readings2[k2], cam2_from_cam1, &batch));
    }
  }
  return evidence;
}

}  // namespace cairn
