#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "cairn/base/progress.h"
#include "cairn/rotation_averaging/rotation_averaging.h"
#include "rotation_averaging/rotation_problem.h"
#include "sparse/laplacian_solver.h"

namespace cairn {

struct StageResult {
  int num_iterations = 0;
  bool converged = false;
};

// In rounds, every camera in turn goes to the rotation that most of its edges agree on (within
// about sigma_start), among those that single edges propose: out of wrong minima that a step by
// least squares cannot leave. Ends when none moves; returns the number of rounds.
int RunConsensusStage(const RotationProblem& problem, const RotationAveragingOptions& options,
                      const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world);

// Minimizes the sum of unsquared errors: each iteration solves min sum_e trust_e |delta_2 - delta_1
// - error_e| by ADMM (Boyd et al. 2011, 6.1; the norm of a whole 3-vector, so that the result does
// not depend on the world frame), with one factorization for all of them.
StageResult RunL1Stage(const RotationProblem& problem, const RotationAveragingOptions& options,
                       const RunContext& run, LaplacianSolver& solver,
                       std::vector<Eigen::Quaterniond>& cam_from_world);

// Iteratively reweighted least squares with the kernel's scale going from sigma_start to sigma_end.
StageResult RunIrlsStage(const RotationProblem& problem, const RotationAveragingOptions& options,
                         const RunContext& run, LaplacianSolver& solver,
                         std::vector<Eigen::Quaterniond>& cam_from_world);

}  // namespace cairn
