#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>
#include <vector>

#include "cairn/rotation_averaging/rotation_averaging.h"

namespace cairn {

// Relative rotations, a line each: `i j R(9, row-major) [weight]` with R = R_j R_i^T, separated by
// blanks; empty lines and lines that begin with # are skipped. Throws IoError with file and line:
// too few or too many numbers, not a rotation (to 1e-2), i = j, a weight that is not positive.
std::vector<RotationEdge> ReadRelativeRotations(const std::string& path);

// Global rotations, a line each in the order of the ids: `i R(9, row-major)`, cam_from_world.
// Throws IoError.
void WriteRotations(const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
                    const std::string& path);

}  // namespace cairn
