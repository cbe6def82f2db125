#include "graph/graph.h"

#include <algorithm>
#include <atomic>
#include <set>

#include "cairn/base/parallel.h"
#include "cairn/base/rng.h"
#include "graph/sum_at_nodes.h"
#include "graph/union_find.h"
#include "support/test.h"

namespace cairn {
namespace {

std::vector<GraphEdge> RandomEdges(int num_nodes, int num_edges, uint64_t seed) {
  Rng rng(seed);
  std::vector<GraphEdge> edges(num_edges);
  for (GraphEdge& e : edges) {
    e = {static_cast<int>(rng.UniformInt(num_nodes)), static_cast<int>(rng.UniformInt(num_nodes))};
  }
  return edges;
}

TEST(UnionFind, JoinsSetsOnce) {
  UnionFind sets(5);
  EXPECT_TRUE(sets.Union(0, 1));
  EXPECT_TRUE(sets.Union(3, 4));
  EXPECT_FALSE(sets.Union(1, 0));
  EXPECT_EQ(sets.Find(0), sets.Find(1));
  EXPECT_NE(sets.Find(1), sets.Find(3));
  EXPECT_TRUE(sets.Union(1, 4));
  EXPECT_NE(sets.Find(3), sets.Find(2));
}

TEST(UnionFind, ThreadsAtOnceMakeTheSetsOfOneThread) {
  constexpr int kNumNodes = 20000;
  const std::vector<GraphEdge> edges = RandomEdges(kNumNodes, 15000, 7);
  UnionFind one(kNumNodes), many(kNumNodes);
  int num_by_one = 0;
  for (const GraphEdge& e : edges) num_by_one += one.Union(e.node1, e.node2);
  std::atomic<int> num_by_many = 0;
  ParallelFor(8, std::ssize(edges),
              [&](int64_t e) { num_by_many += many.Union(edges[e].node1, edges[e].node2); });
  EXPECT_EQ(num_by_one, num_by_many);
  for (int node = 0; node < kNumNodes; ++node) ASSERT_EQ(one.Find(node), many.Find(node));
}

TEST(ConnectedComponents, SortsLargestFirstAndKeepsLonelyNodes) {
  const std::vector<GraphEdge> edges = {{1, 0}, {3, 4}, {4, 6}, {3, 3}};
  const GraphComponents components = ConnectedComponents(7, edges);
  EXPECT_THAT(components.nodes,
              ElementsAre(ElementsAre(3, 4, 6), ElementsAre(0, 1), ElementsAre(2), ElementsAre(5)));
  EXPECT_THAT(components.component_of_node, ElementsAre(1, 1, 2, 0, 0, 3, 0));
}

TEST(ConnectedComponents, EmptyGraph) { EXPECT_EQ(ConnectedComponents(0, {}).Num(), 0); }

TEST(MaximumSpanningForest, TakesTheHeaviestEdgesOfEachComponent) {
  const std::vector<GraphEdge> edges = {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {3, 4}};
  const std::vector<double> weights = {1, 3, 2, 5, 5};
  EXPECT_THAT(MaximumSpanningForest(6, edges, weights), ElementsAre(1, 2, 3));
}

// Cut property: no edge outside the forest is heavier than the lightest edge on the path between
// its ends.
TEST(MaximumSpanningForest, IsMaximalOnRandomGraphs) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const std::vector<GraphEdge> edges = RandomEdges(20, 60, seed);
    Rng rng(seed, "weights");
    std::vector<double> weights(edges.size());
    for (double& w : weights) w = rng.Uniform();
    const std::vector<int> forest = MaximumSpanningForest(20, edges, weights);
    for (size_t e = 0; e < edges.size(); ++e) {
      UnionFind heavier(20);
      for (const int f : forest) {
        if (weights[f] >= weights[e]) heavier.Union(edges[f].node1, edges[f].node2);
      }
      EXPECT_EQ(heavier.Find(edges[e].node1), heavier.Find(edges[e].node2));
    }
  }
}

TEST(WalkForest, VisitsEveryNodeAfterItsParent) {
  const std::vector<GraphEdge> edges = RandomEdges(50, 60, 3);
  const std::vector<double> weights(edges.size(), 1.0);
  const std::vector<int> forest = MaximumSpanningForest(50, edges, weights);
  const std::vector<ForestStep> steps = WalkForest(50, edges, forest);
  ASSERT_EQ(steps.size(), 50u);
  std::vector<char> seen(50, 0);
  int num_roots = 0;
  for (const ForestStep& step : steps) {
    EXPECT_FALSE(seen[step.node]);
    seen[step.node] = 1;
    if (step.parent < 0) {
      ++num_roots;
      continue;
    }
    EXPECT_TRUE(seen[step.parent]);
    const GraphEdge& e = edges[step.edge];
    EXPECT_EQ(std::minmax(e.node1, e.node2), std::minmax(step.node, step.parent));
  }
  EXPECT_EQ(num_roots, ConnectedComponents(50, edges).Num());
}

TEST(WalkForest, BeginsAtTheNodeOfHighestDegree) {
  const std::vector<GraphEdge> edges = {{0, 1}, {1, 2}, {1, 3}};
  const std::vector<int> all = {0, 1, 2};
  EXPECT_EQ(WalkForest(4, edges, all)[0].node, 1);
}

// Of parts that are left without some node, those of fewer than half of the component's nodes.
TEST(HingedParts, AreWhatOneNodeJoinsWithTheRest) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const std::vector<GraphEdge> edges = RandomEdges(21, 28, seed);
    const GraphComponents components = ConnectedComponents(21, edges);
    std::set<int> expected;
    for (int hinge = 0; hinge < 21; ++hinge) {
      std::vector<GraphEdge> rest = edges;
      std::erase_if(rest, [&](const GraphEdge& e) { return e.node1 == hinge || e.node2 == hinge; });
      const int component = components.component_of_node[hinge];
      for (const std::vector<int>& nodes : ConnectedComponents(21, rest).nodes) {
        if (components.component_of_node[nodes[0]] != component || nodes.size() < 2) continue;
        if (2 * nodes.size() < components.nodes[component].size()) {
          expected.insert(nodes.begin(), nodes.end());
        }
      }
    }
    std::set<int> hinged;
    for (const std::vector<int>& part : HingedParts(21, edges)) {
      for (const int v : part) EXPECT_TRUE(hinged.insert(v).second);
    }
    EXPECT_EQ(hinged, expected) << seed;
  }
}

TEST(HingedParts, ALongLoopHasNoneAndDoesNotOverflowTheStack) {
  const int n = 300000;
  std::vector<GraphEdge> edges;
  for (int v = 0; v < n; ++v) edges.push_back({v, (v + 1) % n});
  EXPECT_THAT(HingedParts(n, edges), IsEmpty());
}

TEST(HingedParts, OfALongChainAreItsHalves) {
  const int n = 300000;
  std::vector<GraphEdge> edges;
  for (int v = 0; v + 1 < n; ++v) edges.push_back({v, v + 1});
  const std::vector<std::vector<int>> parts = HingedParts(n, edges);
  ASSERT_EQ(parts.size(), 2u);
  for (const std::vector<int>& part : parts) EXPECT_EQ(std::ssize(part), n / 2 - 1);
}

TEST(BuildAdjacency, ListsEdgesAndNeighbors) {
  const std::vector<GraphEdge> edges = {{0, 1}, {2, 1}};
  const GraphAdjacency adjacency = BuildAdjacency(4, edges);
  EXPECT_THAT(adjacency.EdgesOf(1), ElementsAre(0, 1));
  EXPECT_THAT(adjacency.NeighborsOf(1), ElementsAre(0, 2));
  EXPECT_THAT(adjacency.NeighborsOf(2), ElementsAre(1));
  EXPECT_THAT(adjacency.EdgesOf(3), IsEmpty());
}

TEST(LoopFinder, FindsEveryLoopOfThree) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const std::vector<GraphEdge> edges = RandomEdges(12, 40, seed);
    LoopFinder finder(12, edges);
    const auto joined = [&](int a, int b) {
      return a != b && std::any_of(edges.begin(), edges.end(), [&](const GraphEdge& e) {
               return std::minmax(e.node1, e.node2) == std::minmax(a, b);
             });
    };
    for (int a = 0; a < 12; ++a) {
      for (int b = 0; b < 12; ++b) {
        std::vector<int> expected, found;
        for (int c = 0; c < 12; ++c) {
          if (joined(a, c) && joined(b, c)) expected.push_back(c);
        }
        for (const LoopFinder::Corner& corner : finder.Find(a, b, 100)) {
          found.push_back(corner.node);
          EXPECT_EQ(edges[corner.edge1].node1 + edges[corner.edge1].node2, a + corner.node);
          EXPECT_EQ(edges[corner.edge2].node1 + edges[corner.edge2].node2, b + corner.node);
        }
        EXPECT_EQ(found, expected);
      }
    }
  }
}

TEST(LoopFinder, SpreadsALimitedNumberEvenly) {
  std::vector<GraphEdge> edges;
  for (int c = 2; c < 12; ++c) {
    edges.push_back({0, c});
    edges.push_back({c, 1});
  }
  const auto corners = LoopFinder(12, edges).Find(0, 1, 5);
  ASSERT_EQ(corners.size(), 5u);
  for (int k = 0; k < 5; ++k) EXPECT_EQ(corners[k].node, 2 + 2 * k);
}

// Few edges, and more than one thread takes.
TEST(SumAtNodes, TakesEachEdgeOnceWhateverTheThreads) {
  for (const int num_edges : {1000, kMinParallelEdges + 7}) {
    const std::vector<GraphEdge> edges = RandomEdges(300, num_edges, 1);
    const auto vector_of = [](int e) { return Eigen::Vector3d(e, 1.0 / (e + 1), 1); };
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(300, 3);
    for (int e = 0; e < num_edges; ++e) {
      expected.row(edges[e].node2) += vector_of(e).transpose();
      expected.row(edges[e].node1) -= vector_of(e).transpose();
    }
    const Eigen::MatrixXd sums = SumAtNodes(300, edges, 1, vector_of);
    EXPECT_LT((sums - expected).norm(), 1e-12 * expected.norm());
    EXPECT_EQ(SumAtNodes(300, edges, 3, vector_of), sums);
  }
}

}  // namespace
}  // namespace cairn
