#include "cairn/solvers/eight_point.h"

#include <Eigen/Geometry>
#include <numbers>

#include "cairn/math/decompositions.h"
#include "cairn/solvers/essential.h"
#include "solvers/point_normalization.h"

namespace cairn {
namespace {

using internal::PointNormalization;

// Least squares without the rank constraint, in the coordinates of the samples.
bool LinearSolution(std::span<const PointCorrespondence> samples, PointNormalization* T1,
                    PointNormalization* T2, Eigen::Matrix3d* normalized) {
  if (samples.size() < 8) return false;
  if (!internal::NormalizePoints(samples, &PointCorrespondence::x1, T1) ||
      !internal::NormalizePoints(samples, &PointCorrespondence::x2, T2)) {
    return false;
  }
  Eigen::Matrix<double, 9, 9> AtA = Eigen::Matrix<double, 9, 9>::Zero();
  for (const PointCorrespondence& sample : samples) {
    const Eigen::Vector3d p1 = T1->Apply(sample.x1).homogeneous();
    const Eigen::Vector3d p2 = T2->Apply(sample.x2).homogeneous();
    Eigen::Matrix<double, 9, 1> row;
    row << p2.x() * p1, p2.y() * p1, p1;
    AtA += row.lazyProduct(row.transpose());
  }
  Eigen::Matrix<double, 9, 1> f;
  if (!LeastEigenvector(AtA, &f)) return false;
  *normalized = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(f.data());
  return true;
}

}  // namespace

bool FundamentalFromEightPoints(std::span<const PointCorrespondence> samples, Eigen::Matrix3d* F) {
  PointNormalization T1, T2;
  Eigen::Matrix3d normalized;
  if (!LinearSolution(samples, &T1, &T2, &normalized)) return false;
  *F = (T2.Matrix().transpose() * NearestRankTwo(normalized) * T1.Matrix()).normalized();
  return true;
}

bool EssentialFromEightPoints(std::span<const PointCorrespondence> samples, Eigen::Matrix3d* E) {
  PointNormalization T1, T2;
  Eigen::Matrix3d normalized;
  if (!LinearSolution(samples, &T1, &T2, &normalized)) return false;
  *E = NearestEssential(T2.Matrix().transpose() * normalized * T1.Matrix());
  return true;
}

}  // namespace cairn
