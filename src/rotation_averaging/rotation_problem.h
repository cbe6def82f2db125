#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "cairn/rotation_averaging/rotation_averaging.h"
#include "graph/graph.h"

namespace cairn {

// With fewer edges, a pass over them is over before a second thread is awake.
inline constexpr int kMinParallelEdges = 50000;

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

// World-frame errors: Log(R_2^T * cam2_from_cam1 * R_1) of each edge (3 x m, radians). With
// R <- R Exp(delta), the error becomes error - (delta_2 - delta_1) to first order.
Eigen::Matrix3Xd RotationErrors(const RotationProblem& problem,
                                const std::vector<Eigen::Quaterniond>& cam_from_world,
                                int num_threads);

// At each node, the sum of weight * vector over the edges that end there, less those that begin
// there (n x 3): the right side of least squares for differences of nodes. vectors: 3 x m.
void SumAtNodes(const RotationProblem& problem, std::span<const double> weights,
                const Eigen::Matrix3Xd& vectors, int num_threads, Eigen::MatrixXd& sums);

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
