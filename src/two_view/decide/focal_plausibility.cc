#include "two_view/decide/focal_plausibility.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace cairn::internal {
namespace {

// Squared norms of the blocks of a 3 x 3 matrix at its last row and column.
struct Blocks {
  double corner, column, row, last;
  explicit Blocks(const Eigen::Matrix3d& m)
      : corner(m.topLeftCorner<2, 2>().squaredNorm()),
        column(m.topRightCorner<2, 1>().squaredNorm()),
        row(m.bottomLeftCorner<1, 2>().squaredNorm()),
        last(m(2, 2) * m(2, 2)) {}
};

Eigen::Matrix3d Cofactors(const Eigen::Matrix3d& m) {
  Eigen::Matrix3d cofactors;
  for (int i = 0; i < 3; ++i) {
    cofactors.row(i) = m.row((i + 1) % 3).cross(m.row((i + 2) % 3));
  }
  return cofactors;
}

// The singular values of E = diag(f2, f2, 1) F diag(f1, f1, 1): the sum of their squares is |E|^2,
// the product of the squares of the first two is that of E's cofactors, diag(f2, f2, f2^2) cof(F)
// diag(f1, f1, f1^2).
class SingularValues {
 public:
  explicit SingularValues(const Eigen::Matrix3d& F) : values_(F), cofactors_(Cofactors(F)) {}

  // 4 s1^2 s2^2 / (s1^2 + s2^2)^2: 1 for an essential matrix.
  double Balance(double f1, double f2) const {
    const double a = f1 * f1, b = f2 * f2;
    const double sum = a * b * values_.corner + b * values_.column + a * values_.row + values_.last;
    const double product =
        a * b *
        (cofactors_.corner + a * cofactors_.column + b * cofactors_.row + a * b * cofactors_.last);
    return 4.0 * product / (sum * sum);
  }

 private:
  Blocks values_, cofactors_;
};

bool IsOneCamera(const Camera& camera1, const Camera& camera2) {
  return &camera1 == &camera2 ||
         (camera1.camera_id == camera2.camera_id && camera1.camera_id != kInvalidCameraId);
}

// Focal lengths that a camera may have, in multiples of the one that it is given with.
struct FocalRange {
  double smallest, largest;
};

FocalRange PlausibleFocals(const Camera& camera) {
  if (camera.has_prior_focal_length) return {0.4, 2.5};
  const double side = std::max(camera.width, camera.height) / camera.MeanFocal();
  return {kShortestFocal * side, kLongestFocal * side};
}

}  // namespace

bool HasPlausibleFocals(const Eigen::Matrix3d& F, const Camera& camera1, const Camera& camera2) {
  // The ratio of the singular values changes at most as fast as the focal lengths: half a step from
  // any of these it is off by another 5 %.
  constexpr double kRatio = 0.95;
  constexpr double kGridStep = 1.0 / (kRatio * kRatio);
  constexpr double kNeeded =
      4.0 * kRatio * kRatio / ((1.0 + kRatio * kRatio) * (1.0 + kRatio * kRatio));
  const SingularValues values(F);
  const FocalRange range1 = PlausibleFocals(camera1), range2 = PlausibleFocals(camera2);
  for (double f1 = range1.smallest; f1 < range1.largest; f1 *= kGridStep) {
    if (IsOneCamera(camera1, camera2)) {
      if (values.Balance(f1, f1) >= kNeeded) return true;
      continue;
    }
    for (double f2 = range2.smallest; f2 < range2.largest; f2 *= kGridStep) {
      if (values.Balance(f1, f2) >= kNeeded) return true;
    }
  }
  return false;
}

}  // namespace cairn::internal
