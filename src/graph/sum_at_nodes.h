#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/base/parallel.h"
#include "graph/graph.h"

namespace cairn {

// With fewer edges, a pass over them is over before a second thread is awake.
inline constexpr int kMinParallelEdges = 50000;

// At each node, the sum of vector_of(e) over the edges e that end there, less those that begin
// there (n x 3): the right side of least squares for differences of nodes. Of many edges, parts are
// summed side by side: always the same ones, whatever the threads.
template <typename VectorOf>
Eigen::MatrixXd SumAtNodes(int num_nodes, std::span<const GraphEdge> edges, int num_threads,
                           const VectorOf& vector_of) {
  const auto num_edges = static_cast<int>(edges.size());
  const int num_parts = num_edges < kMinParallelEdges ? 1 : 8;
  std::vector<Eigen::Matrix3Xd> sums(num_parts);
  const auto sum_part = [&](int64_t part) {
    Eigen::Matrix3Xd& sum = sums[part].setZero(3, num_nodes);
    const auto end = static_cast<int>((part + 1) * num_edges / num_parts);
    for (auto e = static_cast<int>(part * num_edges / num_parts); e < end; ++e) {
      const Eigen::Vector3d vector = vector_of(e);
      sum.col(edges[e].node2) += vector;
      sum.col(edges[e].node1) -= vector;
    }
  };
  ParallelFor(num_threads, num_parts, sum_part, 1);
  for (int part = 1; part < num_parts; ++part) sums[0] += sums[part];
  return sums[0].transpose();
}

}  // namespace cairn
