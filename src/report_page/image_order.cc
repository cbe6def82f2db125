#include <cmath>

#include "graph/graph.h"
#include "math/sorted_order.h"
#include "report_page/page_parts.h"

namespace cairn {
namespace {

constexpr int kIterations = 300;  // an order for the eye needs no more

// The Fiedler vector of each component, by power iteration with I + D^-1/2 W D^-1/2.
std::vector<double> FiedlerValues(int num_nodes, const std::vector<WeightedEdge>& edges,
                                  const std::vector<int>& component, int num_components) {
  std::vector<double> root_degree(num_nodes, 0), squared_norm(num_components, 0);
  for (const WeightedEdge& edge : edges) {
    root_degree[edge.node1] += edge.weight;
    root_degree[edge.node2] += edge.weight;
  }
  for (int i = 0; i < num_nodes; ++i) {
    squared_norm[component[i]] += root_degree[i];
    root_degree[i] = std::sqrt(root_degree[i]);
  }
  // Any start will do that is not symmetric: the fractional parts of multiples of the golden ratio.
  std::vector<double> x(num_nodes), next(num_nodes);
  for (int i = 0; i < num_nodes; ++i) x[i] = std::fmod(0.6180339887498949 * (i + 1), 1.0) - 0.5;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    next = x;
    for (const WeightedEdge& edge : edges) {
      const double w = edge.weight / (root_degree[edge.node1] * root_degree[edge.node2]);
      next[edge.node1] += w * x[edge.node2];
      next[edge.node2] += w * x[edge.node1];
    }
    // Without the first eigenvector, D^1/2 1, and scaled to length 1, in each component.
    std::vector<double> along(num_components, 0), length(num_components, 0);
    for (int i = 0; i < num_nodes; ++i) along[component[i]] += next[i] * root_degree[i];
    for (int i = 0; i < num_nodes; ++i) {
      const int c = component[i];
      if (squared_norm[c] > 0) next[i] -= along[c] / squared_norm[c] * root_degree[i];
      length[c] += next[i] * next[i];
    }
    for (int i = 0; i < num_nodes; ++i) {
      const double norm = std::sqrt(length[component[i]]);
      x[i] = norm > 0 ? next[i] / norm : 0.0;
    }
  }
  for (int i = 0; i < num_nodes; ++i) {
    if (root_degree[i] > 0) x[i] /= root_degree[i];
  }
  return x;
}

}  // namespace

std::vector<int> SpectralOrder(int num_nodes, const std::vector<WeightedEdge>& edges) {
  std::vector<GraphEdge> graph;
  for (const WeightedEdge& edge : edges) graph.push_back({edge.node1, edge.node2});
  const GraphComponents components = ConnectedComponents(num_nodes, graph);
  const std::vector<int>& component = components.component_of_node;
  const std::vector<double> value = FiedlerValues(num_nodes, edges, component, components.Num());
  return SortedOrder(num_nodes, [&](int node) {
    return std::make_pair(component[node], value[node]);  // the largest component first
  });
}

}  // namespace cairn
