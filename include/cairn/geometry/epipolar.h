#pragma once

#include <Eigen/Core>
#include <vector>

#include "cairn/geometry/rigid3d.h"

namespace cairn {

// E = [t]x R with |t| = 1, so that x2^T E x1 = 0 for normalized image points (third component 1).
Eigen::Matrix3d EssentialFromPose(const Rigid3d& cam2_from_cam1);

// The four poses (|t| = 1) of an essential matrix (Hartley and Zisserman, 9.6.2).
std::vector<Rigid3d> PosesFromEssential(const Eigen::Matrix3d& E);

// F = K2^-T E K1^-1 for pinhole matrices.
Eigen::Matrix3d FundamentalFromEssential(const Eigen::Matrix3d& E, const Eigen::Matrix3d& K1,
                                         const Eigen::Matrix3d& K2);

// Squared Sampson error of normalized points (third component 1) under E or F, in squared units of
// the points (Hartley and Zisserman, eq. 11.9).
double SquaredSampsonError(const Eigen::Matrix3d& E, const Eigen::Vector2d& x1,
                           const Eigen::Vector2d& x2);
// The same of rays in any direction, in squared radians: the algebraic error of bearings over its
// gradient on the unit spheres (Terekhov and Larsson, "Tangent Sampson error", ICCV 2023).
double SquaredRaySampsonError(const Eigen::Matrix3d& E, const Eigen::Vector3d& ray1,
                              const Eigen::Vector3d& ray2);

// Depths along two rays in any direction, in units of their lengths, at which they come nearest, or
// false if the rays are parallel. A point in front of both cameras has both positive.
bool TriangulateRayDepths(const Rigid3d& cam2_from_cam1, const Eigen::Vector3d& ray1,
                          const Eigen::Vector3d& ray2, double* depth1, double* depth2);

// The pose among `poses` with the most points in front of both cameras, and how many those are.
struct CheiralityResult {
  Rigid3d cam2_from_cam1;
  int num_in_front = 0;
};
CheiralityResult SelectPoseByCheirality(const std::vector<Rigid3d>& poses,
                                        const std::vector<Eigen::Vector2d>& x1,
                                        const std::vector<Eigen::Vector2d>& x2);
CheiralityResult SelectPoseByCheirality(const std::vector<Rigid3d>& poses,
                                        const std::vector<Eigen::Vector3d>& rays1,
                                        const std::vector<Eigen::Vector3d>& rays2);

}  // namespace cairn
