#include "two_view/decide/special_pairs.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/math/so3.h"
#include "robust/match_errors.h"
#include "two_view/search/guided_support.h"
#include "two_view/search/plane_search.h"

namespace cairn::internal {
namespace {

// The rotation that aligns the rays of corresponding points in least squares: first of all of them,
// then of those that agree, ever more closely, to at most max_error_px; `errors` are those at the
// result.
Eigen::Matrix3d FitRotation(const PointPairs& points, double threshold_px, double max_error_px,
                            MatchErrors* errors) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  for (const double reach_px : {std::numeric_limits<double>::infinity(), kReach * threshold_px,
                                kOutside * max_error_px, max_error_px}) {
    errors->SetHomography(points, R);
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
    for (int i = 0; i < points.size(); ++i) {
      if (!((*errors)[i] < reach_px)) continue;
      M += points.Ray2(i).normalized() * points.Ray1(i).normalized().transpose();
    }
    R = NearestRotation(M);
  }
  errors->SetHomography(points, R);
  return R;
}

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
      shifts.push_back(ShiftOf(pair.input, pair.Match(i)));
    }
  }
  const double needed = share * static_cast<double>(inliers.size());
  if (shifts.empty() || static_cast<double>(shifts.size()) < needed) return false;
  // A majority has one shift only if its median is that shift.
  const size_t middle = shifts.size() / 2;
  Eigen::Vector2d median;
  for (int k = 0; k < 2; ++k) {
    std::nth_element(shifts.begin(), shifts.begin() + middle, shifts.end(),
                     [k](const auto& a, const auto& b) { return a[k] < b[k]; });
    median[k] = shifts[middle][k];
  }
  const auto num_equal = std::ranges::count_if(shifts, [&](const Eigen::Vector2d& shift) {
    return (shift - median).norm() < pair.max_error_px;
  });
  return static_cast<double>(num_equal) >= needed;
}

}  // namespace

Eigen::Vector2d ShiftOf(const PairInput& input, const FeatureMatch& match) {
  return input.keypoints2[match.point2].Position() - input.keypoints1[match.point1].Position();
}

std::optional<Eigen::Vector2d> OverlayShift(const PairInput& input,
                                            std::span<const FeatureMatch> matches,
                                            double max_error_px) {
  const Eigen::Vector2d size1(input.camera1->width, input.camera1->height);
  const Eigen::Vector2d size2(input.camera2->width, input.camera2->height);
  constexpr double kAnchors[] = {0.0, 0.5, 1.0};
  for (const double x : kAnchors) {
    for (const double y : kAnchors) {
      const Eigen::Vector2d shift = Eigen::Vector2d(x, y).cwiseProduct(size2 - size1);
      const auto num_equal = std::ranges::count_if(matches, [&](const FeatureMatch& match) {
        return (ShiftOf(input, match) - shift).norm() < max_error_px;
      });
      if (2 * num_equal > std::ssize(matches)) return shift;
    }
  }
  return std::nullopt;
}

SpecialPair ClassifyPair(const PreparedPair& pair, std::span<const int32_t> inliers,
                         double noise_px, const TwoViewOptions& options) {
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
  const double max_rotation_px = MaxTransferErrorPx(noise_px);

  MatchErrors errors;
  const Eigen::Matrix3d R = FitRotation(points, pair.max_error_px, max_rotation_px, &errors);
  if (errors.CountBelow(max_rotation_px) >= needed) {
    special.config = TwoViewConfig::kPanoramic;
    special.H = R;
    return special;
  }
  if (options.detect_watermark &&
      OverlayShift(pair.input, pair.Matches(inliers), pair.max_error_px)) {
    special.config = TwoViewConfig::kWatermark;
    return special;
  }
  // Unlike rotations, planes of a scene are not exact, however little noise there is.
  const double max_plane_px = std::max(std::sqrt(2.0) * pair.max_error_px, max_rotation_px);
  Rng rng(pair.input.seed, "plane", pair.input.pair_id);
  const std::optional<Eigen::Matrix3d> H = FindPlane(pair, some, max_plane_px, &rng);
  if (H) errors.SetHomography(points, *H);
  if (H && errors.CountBelow(max_plane_px) >= needed) {
    special.config = TwoViewConfig::kPlanar;
    special.H = *H;
  }
  return special;
}

}  // namespace cairn::internal
