#include "graph/parallel_rigidity.h"

#include <Eigen/Dense>
#include <algorithm>
#include <numeric>

#include "cairn/base/rng.h"
#include "support/parallel_rigid_components.h"
#include "support/test.h"

namespace cairn {
namespace {

// Are the nodes determined by directions, up to 4 degrees of freedom? By the rank of the rigidity
// matrix at random positions.
bool IsRigidNumerically(const std::vector<int>& nodes, const std::vector<GraphEdge>& edges) {
  Rng rng(7);
  std::vector<int> index(1000, -1);
  for (size_t k = 0; k < nodes.size(); ++k) index[nodes[k]] = static_cast<int>(k);
  const int n = static_cast<int>(nodes.size());
  Eigen::MatrixXd positions(3, n);
  for (int i = 0; i < positions.size(); ++i) positions(i) = rng.Gaussian();
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  for (const GraphEdge& e : edges) {
    const int i = index[e.node1], j = index[e.node2];
    if (i < 0 || j < 0 || i == j) continue;
    const Eigen::Vector3d d = (positions.col(j) - positions.col(i)).normalized();
    const Eigen::Matrix3d P = Eigen::Matrix3d::Identity() - d * d.transpose();
    L.block<3, 3>(3 * i, 3 * i) += P;
    L.block<3, 3>(3 * j, 3 * j) += P;
    L.block<3, 3>(3 * i, 3 * j) -= P;
    L.block<3, 3>(3 * j, 3 * i) -= P;
  }
  return (L.ldlt().vectorD().array() < 1e-9).count() == 4;  // (pivots show the rank)
}

TEST(ParallelRigidity, Triangle) {
  const std::vector<GraphEdge> edges = {{0, 1}, {1, 2}, {2, 0}};
  EXPECT_THAT(ParallelRigidComponents(3, edges), ElementsAre(ElementsAre(0, 1, 2)));
}

TEST(ParallelRigidity, SingleEdgeChainAndSquare) {
  const std::vector<GraphEdge> chain = {{0, 1}, {1, 2}};
  EXPECT_THAT(ParallelRigidComponents(3, chain), ElementsAre(ElementsAre(0, 1), ElementsAre(1, 2)));
  // In space a loop of four has 8 equations for 3 * 4 - 4 = 8 unknowns: rigid. One of five is not.
  const std::vector<GraphEdge> loop4 = {{0, 1}, {1, 2}, {2, 3}, {3, 0}};
  EXPECT_THAT(ParallelRigidComponents(4, loop4), ElementsAre(ElementsAre(0, 1, 2, 3)));
  const std::vector<GraphEdge> loop5 = {{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 0}};
  EXPECT_EQ(ParallelRigidComponents(5, loop5).size(), 5u);
}

TEST(ParallelRigidity, TwoTrianglesSharingANodeCanScaleAgainstEachOther) {
  std::vector<GraphEdge> edges = {{0, 1}, {1, 2}, {2, 0}, {2, 3}, {3, 4}, {4, 2}};
  EXPECT_THAT(ParallelRigidComponents(5, edges),
              ElementsAre(ElementsAre(0, 1, 2), ElementsAre(2, 3, 4)));
  edges.push_back({0, 4});
  EXPECT_THAT(ParallelRigidComponents(5, edges), ElementsAre(ElementsAre(0, 1, 2, 3, 4)));
}

TEST(ParallelRigidity, EmptySelfLoopAndParallelEdges) {
  EXPECT_THAT(ParallelRigidComponents(0, {}), IsEmpty());
  const std::vector<GraphEdge> loops = {{1, 1}};
  EXPECT_THAT(ParallelRigidComponents(3, loops), IsEmpty());
  const std::vector<GraphEdge> twice = {{0, 1}, {1, 0}, {0, 1}};
  EXPECT_THAT(ParallelRigidComponents(2, twice), ElementsAre(ElementsAre(0, 1)));
}

TEST(ParallelRigidity, AgreesWithTheRankOfRandomFrameworks) {
  int num_rigid = 0;
  for (uint64_t seed = 0; seed < 300; ++seed) {
    Rng rng(seed);
    const int n = 5 + static_cast<int>(rng.UniformInt(6));
    const int m = n + static_cast<int>(rng.UniformInt(2 * n));
    std::vector<GraphEdge> edges;
    for (int k = 0; k < m; ++k) {
      edges.push_back({static_cast<int>(rng.UniformInt(n)), static_cast<int>(rng.UniformInt(n))});
    }
    const auto components = ParallelRigidComponents(n, edges);
    std::vector<int> all(n);
    std::iota(all.begin(), all.end(), 0);
    const bool whole = !components.empty() && components[0].size() == all.size();
    num_rigid += whole;
    EXPECT_EQ(whole, IsRigidNumerically(all, edges)) << "seed " << seed;
    for (const auto& nodes : components) EXPECT_TRUE(IsRigidNumerically(nodes, edges));
    for (const GraphEdge& e : edges) {  // each lies in exactly one component
      if (e.node1 == e.node2) continue;
      int num_holding = 0;
      for (const auto& nodes : components) {
        num_holding += std::binary_search(nodes.begin(), nodes.end(), e.node1) &&
                       std::binary_search(nodes.begin(), nodes.end(), e.node2);
      }
      EXPECT_EQ(num_holding, 1);
    }
    rng.Shuffle(edges);
    EXPECT_EQ(ParallelRigidComponents(n, edges), components) << "order of edges, seed " << seed;
  }
  EXPECT_GT(num_rigid, 50);
  EXPECT_LT(num_rigid, 250);
}

}  // namespace
}  // namespace cairn
