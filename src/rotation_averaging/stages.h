#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "cairn/rotation_averaging/rotation_averaging.h"
#include "rotation_averaging/rotation_problem.h"
#include "sparse/laplacian_solver.h"

namespace cairn {

// A problem, and what its edges alone decide.
struct RotationGraph {
  RotationProblem problem;
  std::vector<double> num_loops;  // of each edge, that close (spanning_tree.h)
  LaplacianSolver solver;
};

struct StageResult {
  int num_iterations = 0;
  bool converged = false;
};

// In rounds, every camera in turn goes to the rotation that most of its edges agree on (within
// about sigma_start), among those that single edges propose: out of wrong minima that a step by
// least squares cannot leave. Ends when none moves.
void RunConsensusStage(const RotationProblem& problem, const RotationAveragingOptions& options,
                       const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world);

// In rounds, regions of cameras turn as one, R <- R * turn, where that gains support: out of wrong
// minima that no single camera leaves, since hundreds of pairs of places that look alike agree on a
// wrong rotation. Turns are those that many unexplained edges ask for. A region for one is a cut of
// the graph between the ends of these edges, with few explained edges across; it is found among
// the sets of cameras above a level of electric potential, where the former push current through
// the latter (Grady, "Random walks for image segmentation", 2006; Spielman and Teng, "Spectral
// partitioning works", 2007, for such sweeps). After each round, single cameras follow, and the
// errors of the edges that gave the turns are evened out.
void RunRegionStage(RotationGraph& graph, const RotationAveragingOptions& options,
                    const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world);

// Minimizes the sum of unsquared errors: each iteration solves min sum_e trust_e |delta_2 - delta_1
// - error_e| by ADMM (Boyd et al. 2011, 6.1; the norm of a whole 3-vector, so that the result does
// not depend on the world frame), with one factorization for all of them.
StageResult RunL1Stage(RotationGraph& graph, const RotationAveragingOptions& options,
                       const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world);

// Iteratively reweighted least squares with the kernel's scale going from sigma_start to sigma_end.
StageResult RunIrlsStage(RotationGraph& graph, const RotationAveragingOptions& options,
                         const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world);

}  // namespace cairn
