#include "two_view/decide/special_pairs.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "cairn/solvers/homography.h"
#include "robust/ransac.h"
#include "two_view/search/match_errors.h"

namespace cairn::internal {
namespace {

// The rotation that aligns the rays of corresponding points in least squares, first over all, then
// over those that agree; `errors` are those at the result.
Eigen::Matrix3d FitRotation(const PointPairs& points, double max_error_px, MatchErrors* errors) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  for (int round = 0; round < 3; ++round) {
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
    for (int i = 0; i < points.size(); ++i) {
      // The reach shrinks: rays that disagree by far, then by the threshold, are left out.
      if (round > 0 && !((*errors)[i] < max_error_px * (round == 1 ? kOutside : kNearby))) continue;
      M += points.Ray2(i).normalized() * points.Ray1(i).normalized().transpose();
    }
    R = NearestRotation(M);
    errors->SetHomography(points, R);
  }
  return R;
}

// RANSAC over four points for the dominant plane among the inliers of a pose.
class PlaneEstimator {
 public:
  static constexpr int kSampleSize = HomographyFourPoint::kSampleSize;
  static constexpr int kMaxSolutions = HomographyFourPoint::kMaxSolutions;
  using Model = Eigen::Matrix3d;

  PlaneEstimator(const PointPairs& points, double max_error_px)
      : points_(points), max_error_px_(max_error_px) {}
  int NumData() const { return points_.size(); }
  int Solve(const uint32_t* sample, Model* models) const {
    PointCorrespondence samples[kSampleSize];
    for (int i = 0; i < kSampleSize; ++i) {
      samples[i] = {points_.Point1(sample[i]), points_.Point2(sample[i])};
    }
    return HomographyFourPoint::Solve(samples, models);
  }
  double Score(const Model& H, double) const { return ScoreHomography(points_, H, max_error_px_); }
  double Optimize(Model& H, int* num_inliers) {
    double score = Score(H, 0.0);
    for (int round = 0; round < 2; ++round) {
      errors_.SetHomography(points_, H);
      std::vector<PointCorrespondence> inliers;
      for (const int32_t i : errors_.Below(max_error_px_)) {
        inliers.push_back({points_.Point1(i), points_.Point2(i)});
      }
      Model refined;
      if (!HomographyFromPoints(inliers, &refined)) break;
      const double refined_score = Score(refined, 0.0);
      if (!(refined_score > score)) break;
      score = refined_score;
      H = refined;
    }
    errors_.SetHomography(points_, H);
    *num_inliers = errors_.CountBelow(max_error_px_);
    return score;
  }

 private:
  const PointPairs& points_;
  const double max_error_px_;
  MatchErrors errors_;
};

// True if both points lie in the outer tenth of their image.
bool IsInFrame(const Camera& camera, const Keypoint& keypoint) {
  constexpr double kFrame = 0.1;
  const double margin = kFrame * camera.DiagonalPx();
  return keypoint.x < margin || keypoint.y < margin || keypoint.x > camera.width - margin ||
         keypoint.y > camera.height - margin;
}

// Do most inliers lie in the frame of both images, moved by one and the same shift? Such marks
// (dates, logos) come from the camera or the publisher, not from the scene.
bool IsWatermark(const PreparedPair& pair, std::span<const int32_t> inliers, double share) {
  std::vector<Eigen::Vector2d> shifts;
  for (const int32_t i : inliers) {
    if (IsInFrame(*pair.input.camera1, pair.Keypoint1(i)) &&
        IsInFrame(*pair.input.camera2, pair.Keypoint2(i))) {
      shifts.push_back(pair.Keypoint2(i).Position() - pair.Keypoint1(i).Position());
    }
  }
  const double needed = share * static_cast<double>(inliers.size());
  if (static_cast<double>(shifts.size()) < needed) return false;
  // A majority has one shift only if its median is that shift.
  const size_t middle = shifts.size() / 2;
  Eigen::Vector2d median;
  for (int k = 0; k < 2; ++k) {
    std::nth_element(shifts.begin(), shifts.begin() + middle, shifts.end(),
                     [k](const auto& a, const auto& b) { return a[k] < b[k]; });
    median[k] = shifts[middle][k];
  }
  const auto num_equal =
      std::count_if(shifts.begin(), shifts.end(), [&](const Eigen::Vector2d& shift) {
        return (shift - median).norm() < kNearby * pair.max_error_px;
      });
  return static_cast<double>(num_equal) >= needed;
}

}  // namespace

bool IsOverlay(const PreparedPair& pair, std::span<const int32_t> matches) {
  const Camera &camera1 = *pair.input.camera1, &camera2 = *pair.input.camera2;
  const Eigen::Vector2d size1(camera1.width, camera1.height), size2(camera2.width, camera2.height);
  constexpr double kAnchors[] = {0.0, 0.5, 1.0};
  const double max_distance_px = kNearby * pair.max_error_px;
  for (const double x : kAnchors) {
    for (const double y : kAnchors) {
      const Eigen::Vector2d shift = Eigen::Vector2d(x, y).cwiseProduct(size2 - size1);
      const auto num_equal = std::count_if(matches.begin(), matches.end(), [&](int32_t i) {
        return (pair.Keypoint2(i).Position() - pair.Keypoint1(i).Position() - shift).norm() <
               max_distance_px;
      });
      if (2 * num_equal > std::ssize(matches)) return true;
    }
  }
  return false;
}

SpecialPair ClassifyPair(const PreparedPair& pair, std::span<const int32_t> inliers,
                         const TwoViewOptions& options) {
  SpecialPair special;
  if (options.detect_watermark && IsWatermark(pair, inliers, options.min_special_share)) {
    special.config = TwoViewConfig::kWatermark;
    return special;
  }
  // A share is known well enough from some hundreds of the inliers, spread over all of them.
  const int step = 1 + (static_cast<int>(inliers.size()) - 1) / kEnoughMatches;
  std::vector<int32_t> some;
  for (size_t k = 0; k < inliers.size(); k += step) some.push_back(inliers[k]);
  const int n = static_cast<int>(some.size());
  const double needed = options.min_special_share * n;
  PointPairs points;
  points.SetSubset(pair.points, some.data(), n);
  // Two-dimensional errors: the same noise per coordinate gives sqrt(2) times the error.
  const double max_error_px = std::sqrt(2.0) * pair.max_error_px;

  MatchErrors errors;
  const Eigen::Matrix3d R = FitRotation(points, max_error_px, &errors);
  if (errors.CountBelow(max_error_px) >= needed) {
    special.config = TwoViewConfig::kPanoramic;
    special.rotation = Eigen::Quaterniond(R);
    special.H = R;
    return special;
  }
  if (options.detect_watermark && IsOverlay(pair, inliers)) {
    special.config = TwoViewConfig::kWatermark;
    return special;
  }
  PlaneEstimator estimator(points, max_error_px);
  RansacOptions ransac_options;
  // Only planes with the wanted share matter, and those are found soon.
  ransac_options.max_iterations =
      NumRansacIterations(options.min_special_share, PlaneEstimator::kSampleSize, 0.999);
  ransac_options.min_iterations = 1;
  // Inliers uniform in error have a mean support of 2/3; a first guess may have a fourth of it.
  ransac_options.initial_score = 0.25 * (2.0 / 3.0) * needed;
  Rng rng(pair.input.seed, "plane", pair.input.pair_id);
  const auto report = Ransac(estimator, ransac_options, rng);
  if (report.num_inliers >= needed) {
    special.config = TwoViewConfig::kPlanar;
    special.H = report.model;
  }
  return special;
}

}  // namespace cairn::internal
