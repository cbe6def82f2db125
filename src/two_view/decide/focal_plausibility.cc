#include "two_view/decide/focal_plausibility.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

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

// In steps of this factor; ends are part of it.
std::vector<double> Grid(const FocalRange& range, double step) {
  std::vector<double> grid;
  const int num =
      1 + static_cast<int>(std::ceil(std::log(range.largest / range.smallest) / std::log(step)));
  for (int i = 0; i < num; ++i) {
    const double share = num == 1 ? 0.0 : i / (num - 1.0);
    grid.push_back(range.smallest * std::pow(range.largest / range.smallest, share));
  }
  return grid;
}

struct Proposal {
  Eigen::Vector2d focals;
  double balance;
};

// Climbs from the middle of three neighbours of a grid (golden section over the logarithm).
Proposal Climb(const SingularValues& values, const Eigen::Vector2d& at,
               const Eigen::Vector2d& direction, double step) {
  constexpr double kGolden = 0.618;
  constexpr int kIterations = 10;
  const auto point = [&](double t) -> Eigen::Vector2d {
    return at.array() * (direction.array() * (t * std::log(step))).exp();
  };
  const auto balance = [&](double t) { return values.Balance(point(t)[0], point(t)[1]); };
  double low = -1.0, high = 1.0;
  for (int i = 0; i < kIterations; ++i) {
    const double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
    (balance(a) > balance(b) ? high : low) = balance(a) > balance(b) ? b : a;
  }
  const double t = 0.5 * (low + high);
  return {point(t), balance(t)};
}

constexpr double kGridStep = 1.1;

// The local maxima along a line through the logarithms: both focal lengths, or one, vary.
void AddMaximaAlong(const SingularValues& values, const FocalRange& range,
                    const Eigen::Vector2d& direction, std::vector<Proposal>* proposals) {
  const std::vector<double> grid = Grid(range, kGridStep);
  const auto point = [&](double f) -> Eigen::Vector2d {
    return {std::pow(f, direction[0]), std::pow(f, direction[1])};
  };
  std::vector<double> balances;
  for (const double f : grid) balances.push_back(values.Balance(point(f)[0], point(f)[1]));
  for (size_t i = 0; i < grid.size(); ++i) {
    if (i > 0 && balances[i - 1] > balances[i]) continue;
    if (i + 1 < grid.size() && balances[i + 1] >= balances[i]) continue;
    proposals->push_back(Climb(values, point(grid[i]), direction, kGridStep));
  }
}

void AddBestOfAll(const SingularValues& values, const FocalRange& range1, const FocalRange& range2,
                  std::vector<Proposal>* proposals) {
  Proposal best = {Eigen::Vector2d::Ones(), -1.0};
  for (const double f1 : Grid(range1, kGridStep)) {
    for (const double f2 : Grid(range2, kGridStep)) {
      const double balance = values.Balance(f1, f2);
      if (balance > best.balance) best = {{f1, f2}, balance};
    }
  }
  for (int i = 0; i < 2; ++i)
    best = Climb(values, best.focals, Eigen::Vector2d::Unit(i), kGridStep);
  proposals->push_back(best);
}

bool IsOneCamera(const Camera& camera1, const Camera& camera2) {
  return camera1.camera_id == camera2.camera_id;
}

}  // namespace

FocalRange PlausibleFocals(const Camera& camera) {
  if (camera.has_prior_focal_length) return {0.4, 2.5};
  constexpr double kSmallest = 0.3, kLargest = 6.6;  // larger sides
  const double side = std::max(camera.width, camera.height) / camera.MeanFocal();
  return {kSmallest * side, kLargest * side};
}

bool HasPlausibleFocals(const Eigen::Matrix3d& F, const Camera& camera1, const Camera& camera2) {
  constexpr double kRatio = 0.95;  // of the singular values
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

std::vector<Eigen::Vector2d> ProposeFocals(const Eigen::Matrix3d& F, const Camera& camera1,
                                           const Camera& camera2, int max_num) {
  const SingularValues values(F);
  const FocalRange range1 = PlausibleFocals(camera1), range2 = PlausibleFocals(camera2);
  std::vector<Proposal> proposals;
  if (camera1.has_prior_focal_length) {
    AddMaximaAlong(values, range2, {0.0, 1.0}, &proposals);
  } else if (camera2.has_prior_focal_length) {
    AddMaximaAlong(values, range1, {1.0, 0.0}, &proposals);
  } else {
    AddMaximaAlong(
        values,
        {std::max(range1.smallest, range2.smallest), std::min(range1.largest, range2.largest)},
        {1.0, 1.0}, &proposals);
    if (!IsOneCamera(camera1, camera2)) AddBestOfAll(values, range1, range2, &proposals);
  }
  std::stable_sort(proposals.begin(), proposals.end(),
                   [](const Proposal& a, const Proposal& b) { return a.balance > b.balance; });
  std::vector<Eigen::Vector2d> focals;
  for (const Proposal& proposal : proposals) {
    if (std::ssize(focals) < max_num) focals.push_back(proposal.focals);
  }
  return focals;
}

}  // namespace cairn::internal
