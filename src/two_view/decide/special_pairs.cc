#include "two_view/decide/special_pairs.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "cairn/robust/ransac.h"
#include "cairn/robust/sampson_kernels.h"
#include "cairn/solvers/homography.h"

namespace cairn::internal {
namespace {

int CountBelow(const std::vector<float>& errors, int n, double max_error) {
  return static_cast<int>(std::count_if(errors.begin(), errors.begin() + n,
                                        [max_error](float e) { return e < max_error; }));
}

// The rotation that aligns the rays of corresponding points in least squares, first over all, then
// over those that agree.
Eigen::Matrix3d FitRotation(const PointPairs& points, double max_error_px,
                            std::vector<float>* errors) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  errors->assign(points.num_blocks() * PointPairs::kBlock, 0.0f);
  for (int round = 0; round < 3; ++round) {
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
    for (int i = 0; i < points.size(); ++i) {
      // The reach shrinks: rays that disagree by far, then by the threshold, are left out.
      if (round > 0 && !((*errors)[i] < max_error_px * (round == 1 ? 8.0 : 2.0))) continue;
      M += points.Ray2(i).normalized() * points.Ray1(i).normalized().transpose();
    }
    R = NearestRotation(M);
    HomographyErrors(points, R, errors->data());
  }
  return R;
}

// RANSAC over four points for the dominant plane among the inliers of a pose.
class PlaneEstimator {
 public:
  static constexpr int kSampleSize = HomographyFourPoint::kSampleSize;
  static constexpr int kMaxSolutions = HomographyFourPoint::kMaxSolutions;
  using Model = Eigen::Matrix3d;

  PlaneEstimator(const PointPairs& points, double max_error_px, std::vector<float>* errors)
      : points_(points), max_error_px_(max_error_px), errors_(*errors) {
    errors_.resize(points.num_blocks() * PointPairs::kBlock);
  }
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
    std::vector<PointCorrespondence>& inliers = inliers_;
    for (int round = 0; round < 2; ++round) {
      HomographyErrors(points_, H, errors_.data());
      inliers.clear();
      for (int i = 0; i < points_.size(); ++i) {
        if (errors_[i] < max_error_px_) {
          inliers.push_back({points_.Point1(i), points_.Point2(i)});
        }
      }
      Model refined;
      if (!HomographyFromPoints(inliers, &refined)) break;
      const double refined_score = Score(refined, 0.0);
      if (!(refined_score > score)) break;
      score = refined_score;
      H = refined;
    }
    HomographyErrors(points_, H, errors_.data());
    *num_inliers = CountBelow(errors_, points_.size(), max_error_px_);
    return score;
  }

 private:
  const PointPairs& points_;
  const double max_error_px_;
  std::vector<float>& errors_;
  std::vector<PointCorrespondence> inliers_;
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
bool IsWatermark(const PairInput& input, const PreparedPair& pair, std::span<const int32_t> inliers,
                 double share) {
  std::vector<Eigen::Vector2d> shifts;
  for (const int32_t i : inliers) {
    const FeatureMatch& match = input.matches[pair.match_index[i]];
    const Keypoint& keypoint1 = input.keypoints1[match.point1];
    const Keypoint& keypoint2 = input.keypoints2[match.point2];
    if (IsInFrame(*input.camera1, keypoint1) && IsInFrame(*input.camera2, keypoint2)) {
      shifts.push_back(keypoint2.Position() - keypoint1.Position());
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
        return (shift - median).norm() < 2.0 * pair.max_error_px;
      });
  return static_cast<double>(num_equal) >= needed;
}

}  // namespace

bool IsOverlay(const PairInput& input, const PreparedPair& pair, std::span<const int32_t> matches) {
  const Eigen::Vector2d size1(input.camera1->width, input.camera1->height);
  const Eigen::Vector2d size2(input.camera2->width, input.camera2->height);
  constexpr double kAnchors[] = {0.0, 0.5, 1.0};
  const double max_distance_px = 2.0 * pair.max_error_px;
  for (const double x : kAnchors) {
    for (const double y : kAnchors) {
      const Eigen::Vector2d shift = Eigen::Vector2d(x, y).cwiseProduct(size2 - size1);
      const auto num_equal = std::count_if(matches.begin(), matches.end(), [&](int32_t i) {
        const FeatureMatch& match = input.matches[pair.match_index[i]];
        return (input.keypoints2[match.point2].Position() -
                input.keypoints1[match.point1].Position() - shift)
                   .norm() < max_distance_px;
      });
      if (2 * num_equal > std::ssize(matches)) return true;
    }
  }
  return false;
}

SpecialPair ClassifyPair(const PairInput& input, const PreparedPair& pair,
                         std::span<const int32_t> inliers, const TwoViewOptions& options,
                         SpecialPairScratch* scratch) {
  SpecialPair special;
  if (options.detect_watermark && IsWatermark(input, pair, inliers, options.min_special_share)) {
    special.config = TwoViewConfig::kWatermark;
    return special;
  }
  // A share is known well enough from some hundreds of the inliers, spread over all of them.
  constexpr int kMaxSample = 256;
  const int step = 1 + (static_cast<int>(inliers.size()) - 1) / kMaxSample;
  scratch->indices.clear();
  for (size_t k = 0; k < inliers.size(); k += step) scratch->indices.push_back(inliers[k]);
  const int n = static_cast<int>(scratch->indices.size());
  const double needed = options.min_special_share * n;
  scratch->inliers.SetSubset(pair.points, scratch->indices.data(), n);
  const PointPairs& points = scratch->inliers;
  // Two-dimensional errors: the same noise per coordinate gives sqrt(2) times the error.
  const double max_error_px = std::sqrt(2.0) * pair.max_error_px;

  const Eigen::Matrix3d R = FitRotation(points, max_error_px, &scratch->errors);
  if (CountBelow(scratch->errors, n, max_error_px) >= needed) {
    special.config = TwoViewConfig::kPanoramic;
    special.rotation = Eigen::Quaterniond(R);
    special.H = R;
    return special;
  }
  if (options.detect_watermark && IsOverlay(input, pair, inliers)) {
    special.config = TwoViewConfig::kWatermark;
    return special;
  }
  PlaneEstimator estimator(points, max_error_px, &scratch->errors);
  RansacOptions ransac_options;
  // Only planes with the wanted share matter, and those are found soon.
  ransac_options.max_iterations =
      NumRansacIterations(options.min_special_share, PlaneEstimator::kSampleSize, 0.999);
  ransac_options.min_iterations = 1;
  // Inliers uniform in error have a mean support of 2/3; a first guess may have a fourth of it.
  ransac_options.initial_score = 0.25 * (2.0 / 3.0) * needed;
  Rng rng(input.seed, "plane", input.pair_id);
  const auto report = Ransac(estimator, ransac_options, rng);
  if (report.num_inliers >= needed) {
    special.config = TwoViewConfig::kPlanar;
    special.H = report.model;
  }
  return special;
}

}  // namespace cairn::internal
