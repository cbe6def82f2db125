#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "cairn/rotation_averaging/rotation_averaging.h"
#include "rotation_averaging/rotation_problem.h"
#include "rotation_averaging/stages.h"
#include "sparse/laplacian_solver.h"

namespace cairn {

// Rotations for IRLS to begin with.
struct RotationStart {
  std::vector<Eigen::Quaterniond> cam_from_world;
  LaplacianSolver solver;  // of the problem
  StageResult l1 = {};
  int num_consensus_rounds = 0;
};

// Spanning tree, L1, consensus of single cameras; and the same by groups of cameras, each taken as
// one: where whole places look alike, their many pairs agree on a wrong rotation, and no camera
// leaves it alone, while among groups that is one edge against those of all neighbors. Groups are
// grouped in turn. The start that the edges support better is taken.
RotationStart FindRotationStart(const RotationProblem& problem,
                                const RotationAveragingOptions& options, const RunContext& run);

}  // namespace cairn
