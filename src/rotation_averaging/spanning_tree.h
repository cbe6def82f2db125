#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "rotation_averaging/rotation_problem.h"

namespace cairn {

// Rotations along a maximum spanning forest (weight times consistent loops), and its roots: the
// gauge of each component.
struct SpanningTreeRotations {
  std::vector<Eigen::Quaterniond> cam_from_world;
  // Of each edge the loops of three that close within 5 degrees; where there are more than 32, by
  // the share of 32 that do.
  std::vector<double> num_loops;
  std::vector<char> is_root;
};
SpanningTreeRotations InitializeBySpanningTree(const RotationProblem& problem, int num_threads);

}  // namespace cairn
