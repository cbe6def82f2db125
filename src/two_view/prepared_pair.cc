#include "two_view/prepared_pair.h"

#include <algorithm>

#include "cairn/base/check.h"

namespace cairn::internal {
namespace {

// As in the paper, 0.05 % of the diagonal, but not below what a keypoint's position is worth.
double AutomaticThreshold(const Camera& camera1, const Camera& camera2) {
  return std::max(1.0, 0.0005 * 0.5 * (camera1.DiagonalPx() + camera2.DiagonalPx()));
}

// A line of the length of the diagonal, one pixel wide on either side.
double BandPerPx(const Camera& camera) {
  return 2.0 * camera.DiagonalPx() / (static_cast<double>(camera.width) * camera.height);
}

}  // namespace

void PreparePair(const PairInput& input, const TwoViewOptions& options, PreparedPair* pair) {
  CAIRN_CHECK(input.camera1 != nullptr && input.camera2 != nullptr);
  const Camera& camera1 = *input.camera1;
  const Camera& camera2 = *input.camera2;
  pair->max_error_px =
      options.max_error_px > 0.0 ? options.max_error_px : AutomaticThreshold(camera1, camera2);
  pair->chance_per_px = 0.5 * (BandPerPx(camera1) + BandPerPx(camera2));
  const int num_matches = static_cast<int>(input.matches.size());
  pair->points.Reset(num_matches, camera1.MeanFocal(), camera2.MeanFocal());
  pair->match_index.clear();
  for (int i = 0; i < num_matches; ++i) {
    const FeatureMatch& match = input.matches[i];
    CAIRN_CHECK_LT(match.point1, input.keypoints1.size());
    CAIRN_CHECK_LT(match.point2, input.keypoints2.size());
    const auto x1 = camera1.CamFromImg(input.keypoints1[match.point1].Position());
    const auto x2 = camera2.CamFromImg(input.keypoints2[match.point2].Position());
    if (!x1 || !x2) continue;
    pair->points.Set(static_cast<int>(pair->match_index.size()), *x1, *x2);
    pair->match_index.push_back(i);
  }
  pair->points.Truncate(static_cast<int>(pair->match_index.size()));
}

}  // namespace cairn::internal
