#include "cairn/solvers/homography.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "cairn/math/decompositions.h"
#include "solvers/point_normalization.h"

namespace cairn {
namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Twice the area of a triangle, with sign.
double Area(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// A homography between views of one side of a plane keeps the orientation of every triple of
// points; a triple without area fixes nothing.
bool IsOrientedSample(const PointCorrespondence* s) {
  static constexpr int kTriples[4][3] = {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};
  double sign = 0.0;
  for (const auto& t : kTriples) {
    const double area1 = Area(s[t[0]].x1, s[t[1]].x1, s[t[2]].x1);
    const double area2 = Area(s[t[0]].x2, s[t[1]].x2, s[t[2]].x2);
    const double product = area1 * area2;
    if (product == 0.0 || product * sign < 0.0) return false;
    sign = product;
  }
  return true;
}

}  // namespace

int HomographyFourPoint::Solve(const Sample* samples, Model* models) {
  if (!IsOrientedSample(samples)) return 0;
  // Projective bases: each side maps the unit vectors and (1, 1, 1) to its four points, so
  // H = B2 B1^-1 (Hartley and Zisserman, 4.1).
  auto basis = [samples](Eigen::Vector2d PointCorrespondence::*side, Eigen::Matrix3d* B) {
    for (int k = 0; k < 3; ++k) B->col(k) = (samples[k].*side).homogeneous();
    const Eigen::Vector3d weights =
        B->inverse() * Eigen::Vector3d((samples[3].*side).homogeneous());
    *B = (*B * weights.asDiagonal()).eval();
    return weights.allFinite();
  };
  Eigen::Matrix3d B1, B2;
  if (!basis(&PointCorrespondence::x1, &B1) || !basis(&PointCorrespondence::x2, &B2)) return 0;
  models[0] = B2 * B1.inverse();
  models[0].normalize();
  return models[0].allFinite() ? 1 : 0;
}

bool HomographyFromPoints(std::span<const PointCorrespondence> samples, Eigen::Matrix3d* H) {
  if (samples.size() < 4) return false;
  internal::PointNormalization T1, T2;
  if (!internal::NormalizePoints(samples, &PointCorrespondence::x1, &T1) ||
      !internal::NormalizePoints(samples, &PointCorrespondence::x2, &T2)) {
    return false;
  }
  Eigen::Matrix<double, 9, 9> AtA = Eigen::Matrix<double, 9, 9>::Zero();
  for (const PointCorrespondence& sample : samples) {
    const Eigen::RowVector3d p = T1.Apply(sample.x1).homogeneous().transpose();
    const Eigen::Vector2d q = T2.Apply(sample.x2);
    Eigen::Matrix<double, 2, 9> rows;
    rows << p, 0.0, 0.0, 0.0, -q.x() * p, 0.0, 0.0, 0.0, p, -q.y() * p;
    AtA += rows.transpose().lazyProduct(rows);
  }
  Eigen::Matrix<double, 9, 1> h;
  if (!LeastEigenvector(AtA, &h)) return false;
  const Eigen::Matrix3d normalized = Eigen::Map<const RowMajor3d>(h.data());
  *H = (T2.Matrix().inverse() * normalized * T1.Matrix()).normalized();
  return H->allFinite();
}

int DecomposeHomography(const Eigen::Matrix3d& H, PlaneMotion* motions) {
  constexpr double kMinSpread = 1e-9;  // of the singular values of a plane's
  // Scale to middle singular value 1 and positive determinant: H = R + (t / d) n^T.
  auto [U, V, s] = SingularValues(H);
  if (!(s.z() > 0.0)) return 0;
  Eigen::Matrix3d scaled = H / s.y();
  if (scaled.determinant() < 0.0) scaled = -scaled;
  s /= s.y();
  const double a = s.x() * s.x() - 1.0;  // both >= 0
  const double c = 1.0 - s.z() * s.z();
  if (a + c <= 2.0 * kMinSpread) {
    const Eigen::Matrix3d R = U * V.transpose();
    motions[0] = {Rigid3d(R.determinant() < 0.0 ? Eigen::Matrix3d(-R) : R, Eigen::Vector3d::Zero()),
                  Eigen::Vector3d::Zero()};
    return 1;
  }
  // Vectors of the plane whose lengths H keeps: they lie in the scene plane's direction.
  const Eigen::Vector3d v2 = V.col(1);
  int count = 0;
  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector3d u =
        (std::sqrt(std::max(0.0, c)) * V.col(0) + sign * std::sqrt(std::max(0.0, a)) * V.col(2)) /
        std::sqrt(a + c);
    const Eigen::Vector3d normal = v2.cross(u);
    const Eigen::Vector3d Hv2 = scaled * v2, Hu = scaled * u;
    Eigen::Matrix3d from, onto;
    from << v2, u, normal;
    onto << Hv2, Hu, Hv2.cross(Hu);
    const Eigen::Matrix3d R = onto * from.transpose();
    const Eigen::Vector3d t = (scaled - R) * normal;
    motions[count++] = {Rigid3d(R, t), normal};
    motions[count++] = {Rigid3d(R, -t), -normal};
  }
  return count;
}

}  // namespace cairn
