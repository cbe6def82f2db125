#include "cairn/scene/view_graph.h"

#include <set>

#include "cairn/base/error.h"
#include "support/test.h"

namespace cairn {
namespace {

ViewEdge Edge(image_t id1, image_t id2) {
  ViewEdge edge;
  edge.image_id1 = id1;
  edge.image_id2 = id2;
  return edge;
}

TEST(ViewGraph, NormalizeSortsBoth) {
  ViewGraph graph;
  graph.image_ids = {3, 1, 2, 3};
  graph.edges = {Edge(2, 3), Edge(1, 3), Edge(1, 2)};
  graph.Normalize();
  EXPECT_EQ(graph.image_ids, (std::vector<image_t>{1, 2, 3}));
  EXPECT_EQ(graph.edges[0].PairId(), ImagePairToPairId(1, 2));
  EXPECT_EQ(graph.edges[2].PairId(), ImagePairToPairId(2, 3));
}

TEST(ViewGraph, NormalizeRefusesWrongEdges) {
  for (const std::vector<ViewEdge>& edges :
       {std::vector{Edge(2, 1)}, std::vector{Edge(1, 1)}, std::vector{Edge(1, 9)},
        std::vector{Edge(1, 2), Edge(1, 2)}}) {
    ViewGraph graph;
    graph.image_ids = {1, 2};
    graph.edges = edges;
    EXPECT_THROW(graph.Normalize(), BugError);
  }
}

TEST(ViewGraph, RemovedEdgesAreNotActive) {
  ViewGraph graph;
  graph.image_ids = {1, 2, 3};
  graph.edges = {Edge(1, 2), Edge(1, 3)};
  EXPECT_EQ(graph.NumActiveEdges(), 2);
  graph.edges[0].removal = EdgeRemoval::kNoPose;
  EXPECT_EQ(graph.NumActiveEdges(), 1);
}

TEST(ViewGraph, RemovalNamesAreDistinct) {
  std::set<std::string_view> names;
  for (int i = 0; i <= static_cast<int>(EdgeRemoval::kModelInconsistent); ++i) {
    names.insert(EdgeRemovalName(static_cast<EdgeRemoval>(i)));
  }
  EXPECT_EQ(names.size(), static_cast<size_t>(EdgeRemoval::kModelInconsistent) + 1);
  EXPECT_EQ(names.count(""), 0u);
}

}  // namespace
}  // namespace cairn
