#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "graph/graph.h"
#include "rotation_averaging/rotation_problem.h"

namespace cairn {

// How many loops of three through each edge close within max_error_deg; at most max_loops loops an
// edge are looked at, spread evenly over those there are.
std::vector<int> CountConsistentLoops(const RotationProblem& problem, double max_error_deg,
                                      int max_loops, int num_threads);

// Rotations along a maximum spanning forest (weight times consistent loops), and its roots: the
// gauge of each component.
struct SpanningTreeRotations {
  std::vector<Eigen::Quaterniond> cam_from_world;
  std::vector<char> is_root;
};
SpanningTreeRotations InitializeBySpanningTree(const RotationProblem& problem, int num_threads);

}  // namespace cairn
