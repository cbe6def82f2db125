#include "two_view/focal_plausibility.h"

#include <Eigen/Geometry>

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

}  // namespace

bool HasPlausibleFocals(const Eigen::Matrix3d& F, bool one_camera) {
  constexpr double kSmallest = 0.4, kLargest = 2.5, kStep = 1.1;
  constexpr double kRatio = 0.95;  // of the singular values
  constexpr double kNeeded =
      4.0 * kRatio * kRatio / ((1.0 + kRatio * kRatio) * (1.0 + kRatio * kRatio));
  const SingularValues values(F);
  for (double f1 = kSmallest; f1 < kLargest; f1 *= kStep) {
    if (one_camera) {
      if (values.Balance(f1, f1) >= kNeeded) return true;
      continue;
    }
    for (double f2 = kSmallest; f2 < kLargest; f2 *= kStep) {
      if (values.Balance(f1, f2) >= kNeeded) return true;
    }
  }
  return false;
}

}  // namespace cairn::internal
