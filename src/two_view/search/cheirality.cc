#include "two_view/search/cheirality.h"

#include <algorithm>
#include <vector>

namespace cairn::internal {

Cheirality::Cheirality(const PreparedPair& pair)
    : pair_(pair),
      far_angle_(2.0 * pair.max_error_px /
                 std::min(pair.points.focal1_px(), pair.points.focal2_px())) {}

Cheirality::Choice Cheirality::Choose(const Rigid3d& pose, std::span<const int32_t> matches) const {
  const size_t step = 1 + matches.size() / 100;
  std::vector<Eigen::Vector3d> rays1, rays2;
  for (size_t k = 0; k < matches.size(); k += step) {
    rays1.push_back(pair_.points.Ray1(matches[k]));
    rays2.push_back(pair_.points.Ray2(matches[k]));
  }
  const CheiralityResult best =
      SelectPoseByCheirality(EssentialFromPose(pose), rays1, rays2, far_angle_);
  const auto num_asked = static_cast<double>(std::max<size_t>(1, rays1.size()));
  return {best.cam2_from_cam1, best.num_in_front / num_asked};
}

double Cheirality::WeightOf(const Rigid3d& pose) {
  errors_.SetSampson(pair_.points, EssentialFromPose(pose));
  return Choose(pose, errors_.Below(pair_.max_error_px)).share;
}

}  // namespace cairn::internal
