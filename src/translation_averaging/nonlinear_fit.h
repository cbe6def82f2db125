#pragma once

#include <vector>

#include "cairn/base/run_context.h"
#include "translation_averaging/direction_problem.h"
#include "translation_averaging/position_system.h"

namespace cairn {

// (x - center)' information (x - center) / 2, of a camera at x.
struct CenterTerm {
  int camera = 0;
  Eigen::Vector3d center;
  Eigen::Matrix3d information;
};

// How every edge and ray counts, and the angles from which their errors count linearly.
struct FitWeights {
  std::vector<double> edges;
  std::vector<double> rays;
  std::vector<CenterTerm> centers = {};  // at most one a camera
  double edge_huber_deg = 1.0;
  double ray_huber_deg = 1.0;
  double tolerance = 1e-6;  // the fit ends when its cost falls by less than this share
  int max_iterations = 100;
};

struct FitResult {
  double initial_cost = 0;
  double final_cost = 0;
  int num_iterations = 0;
  bool converged = false;
};

// Levenberg-Marquardt over cameras and points from a given start. Of each term, with the difference
// of positions D = c2 - c1 or X - c and its measured direction v, rho(|v - D / |D||) with Huber's
// function rho (Wilson and Snavely 2014, eq. 5); and of the centers that are known beforehand,
// their terms. Points are eliminated first, then cameras.
FitResult FitPositions(const DirectionProblem& problem, const FitWeights& weights,
                       PositionSystem& system, Positions& positions, const RunContext& run);

}  // namespace cairn
