#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "cairn/rotation_averaging/rotation_averaging.h"
#include "graph/graph.h"
#include "graph/sum_at_nodes.h"

namespace cairn {

// Rotation averaging over nodes 0 .. n-1 (the images that have an edge, by increasing id) and edges
// in an order that depends on their content alone: sorted by their nodes, node1 < node2.
struct RotationProblem {
  std::vector<image_t> image_ids;
  std::vector<GraphEdge> edges;
  std::vector<Eigen::Quaterniond> relative;  // cam2_from_cam1 of each edge
  std::vector<double> weights;               // as given
  std::vector<double> trust;                 // by SetTrust
  std::vector<int> edge_of_input;            // index in `edges` of each edge given
  GraphAdjacency adjacency;

  // weight^weight_power, 1 in the median.
  void SetTrust(double weight_power);

  int NumNodes() const { return static_cast<int>(image_ids.size()); }
  int NumEdges() const { return static_cast<int>(edges.size()); }
};

RotationProblem MakeRotationProblem(std::span<const RotationEdge> edges);

// World-frame error of an edge: Log(R_2^T * cam2_from_cam1 * R_1), radians. With R <- R Exp(delta),
// it becomes error - (delta_2 - delta_1) to first order.
Eigen::Vector3d RotationError(const RotationProblem& problem,
                              const std::vector<Eigen::Quaterniond>& cam_from_world, int edge);

// Of each edge (3 x m).
Eigen::Matrix3Xd RotationErrors(const RotationProblem& problem,
                                const std::vector<Eigen::Quaterniond>& cam_from_world,
                                int num_threads);

// Support of an edge is its trust divided by this, 1 + (angle / sigma)^2 with 2 sin(angle / 2) for
// the angle, by the cosines of half of the angles.
template <typename Derived>
auto SupportLoss(const Eigen::ArrayBase<Derived>& cos_half, double sigma) {
  return 1.0 + 4.0 / (sigma * sigma) * (1.0 - cos_half.square()).max(0.0);
}

// R <- R Exp(delta), delta n x 3; returns the mean angle moved, radians.
double ApplyRotationUpdate(const Eigen::MatrixXd& delta,
                           std::vector<Eigen::Quaterniond>& cam_from_world);

}  // namespace cairn
