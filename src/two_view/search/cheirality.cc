#include "two_view/search/cheirality.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "cairn/geometry/epipolar.h"
#include "cairn/solvers/essential.h"

namespace cairn::internal {

Cheirality::Cheirality(const PreparedPair& pair) : pair_(pair) {
  const double angle =
      2.0 * pair.max_error_px / std::min(pair.points.focal1_px(), pair.points.focal2_px());
  squared_far_angle_ = angle * angle;
}

bool Cheirality::IsInFront(const Rigid3d& pose, const Eigen::Matrix3d& R, int match) const {
  const Eigen::Vector3d a = R * pair_.points.Ray1(match);
  const Eigen::Vector3d b = pair_.points.Ray2(match);
  const Eigen::Vector3d& t = pose.translation;
  const double aa = a.squaredNorm(), bb = b.squaredNorm(), ab = a.dot(b);
  const double det = aa * bb - ab * ab;  // aa bb sin^2 of the angle between the rays
  if (ab > 0.0 && det < squared_far_angle_ * aa * bb) return true;
  const double at = a.dot(t), bt = b.dot(t);
  return ab * bt - bb * at > 0.0 && aa * bt - ab * at > 0.0;
}

Cheirality::Choice Cheirality::Choose(const Rigid3d& pose, std::span<const int32_t> matches) const {
  const EssentialDecomposition parts = DecomposeEssential(EssentialFromPose(pose));
  const size_t step = 1 + matches.size() / 100;
  Choice best{pose};
  int best_count = -1, num_tried = 0;
  for (const Eigen::Matrix3d& R : {parts.R1, parts.R2}) {
    for (const double sign : {1.0, -1.0}) {
      const Rigid3d candidate(R, sign * parts.t);
      int count = 0;
      num_tried = 0;
      for (size_t k = 0; k < matches.size(); k += step, ++num_tried) {
        count += IsInFront(candidate, R, matches[k]);
      }
      if (count > best_count) {
        best_count = count;
        best.pose = candidate;
      }
    }
  }
  if (num_tried > 0) best.share = static_cast<double>(best_count) / num_tried;
  return best;
}

double Cheirality::WeightOf(const Rigid3d& pose) {
  // Wrong matches may be behind right poses; few of them are no reason to choose between these.
  constexpr double kMostInFront = 0.75;
  errors_.SetSampson(pair_.points, EssentialFromPose(pose));
  const double share = Choose(pose, errors_.Below(pair_.max_error_px)).share;
  return share < kMostInFront ? share : 1.0;
}

}  // namespace cairn::internal
