#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "cairn/geometry/rigid3d.h"

namespace cairn {

// E = [t]x R with |t| = 1, so that x2^T E x1 = 0 for normalized image points (third component 1).
Eigen::Matrix3d EssentialFromPose(const Rigid3d& cam2_from_cam1);

// The essential matrix nearest to a 3x3 matrix in Frobenius norm, scaled to singular values
// (1, 1, 0).
Eigen::Matrix3d NearestEssential(const Eigen::Matrix3d& matrix);

// The four poses (|t| = 1) of an essential matrix of any sign and scale. Closed form (Horn,
// "Recovering baseline and orientation from essential matrix", 1990), so no SVD; E must satisfy the
// constraints of an essential matrix.
std::array<Rigid3d, 4> PosesFromEssential(const Eigen::Matrix3d& E);

// F = K2^-T E K1^-1 for pinhole matrices.
Eigen::Matrix3d FundamentalFromEssential(const Eigen::Matrix3d& E, const Eigen::Matrix3d& K1,
                                         const Eigen::Matrix3d& K2);

// Squared Sampson error of normalized points (third component 1) under E or F, in squared units of
// the points (Hartley and Zisserman, eq. 11.9).
double SquaredSampsonError(const Eigen::Matrix3d& E, const Eigen::Vector2d& x1,
                           const Eigen::Vector2d& x2);

// Whether points are in front of both cameras, by their rays in any direction and of any length.
// Where rays are within `far_angle` (small; radians) of parallel, noise decides the signs of the
// depths: these points count as in front.
class CheiralityTest {
 public:
  explicit CheiralityTest(const Rigid3d& cam2_from_cam1, double far_angle = 0.0)
      : R_(cam2_from_cam1.RotationMatrix()),
        t_(cam2_from_cam1.translation),
        squared_far_angle_(far_angle * far_angle) {}

  bool IsInFront(const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2) const;

 private:
  Eigen::Matrix3d R_;
  Eigen::Vector3d t_;
  double squared_far_angle_;
};

// Of the four poses of an essential matrix (as PosesFromEssential takes it) the one with the most
// points in front of both cameras, and how many those are.
struct CheiralityResult {
  Rigid3d cam2_from_cam1;
  int num_in_front = 0;
};
CheiralityResult SelectPoseByCheirality(const Eigen::Matrix3d& E,
                                        const std::vector<Eigen::Vector3d>& rays1,
                                        const std::vector<Eigen::Vector3d>& rays2,
                                        double far_angle = 0.0);

}  // namespace cairn
