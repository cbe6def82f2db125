#include "cairn/view_graph/view_graph_text.h"

#include <nlohmann/json.hpp>

#include "support/test.h"

namespace cairn {
namespace {

ViewGraph SmallGraph() {
  ViewGraph graph;
  graph.image_ids = {1, 2, 7};
  ViewEdge edge;
  edge.image_id1 = 1;
  edge.image_id2 = 2;
  edge.num_inliers = 150;
  edge.residual_px = 0.5;
  edge.verifier = "five_point";
  edge.cam2_from_cam1.translation = Eigen::Vector3d(0, 0.6, 0.8);
  graph.edges.push_back(edge);
  edge.image_id2 = 7;
  edge.removal = EdgeRemoval::kAmbiguous;
  graph.edges.push_back(edge);
  return graph;
}

TEST(ViewGraphText, JsonIsParsedAndComplete) {
  const std::map<image_t, std::string> names = {{1, "a \"b\"\\c\n.jpg"}, {2, "zwei/ä.jpg"}};
  const auto json = nlohmann::json::parse(ViewGraphToJson(SmallGraph(), names));
  EXPECT_EQ(json["images"].size(), 3u);
  EXPECT_EQ(json["images"][0]["name"], "a \"b\"\\c\n.jpg");
  EXPECT_EQ(json["images"][1]["name"], "zwei/ä.jpg");
  EXPECT_EQ(json["images"][2]["name"], "7");
  EXPECT_EQ(json["images"][0]["degree"], 1);
  EXPECT_TRUE(json["images"][2]["component"].is_null());
  EXPECT_EQ(json["edges"][0]["status"], "in_use");
  EXPECT_EQ(json["edges"][1]["status"], "ambiguous");
  EXPECT_EQ(json["edges"][0]["tvec"], nlohmann::json({0.0, 0.6, 0.8}));
  EXPECT_EQ(json["edges"][0]["verifier"], "five_point");
  EXPECT_EQ(json["removed"]["ambiguous"], 1);
  EXPECT_EQ(json["components"], nlohmann::json::parse("[[1, 2]]"));
}

TEST(ViewGraphText, DotShowsRemovedEdgesDashed) {
  const std::string dot = ViewGraphToDot(SmallGraph(), {{1, "a.jpg"}});
  EXPECT_THAT(dot, HasSubstr("1 [label=\"a.jpg\"];"));
  EXPECT_THAT(dot, HasSubstr("1 -- 2 [color=black, penwidth=1.98, tooltip="));
  EXPECT_THAT(dot, HasSubstr("1 -- 7 [color=purple, penwidth=1.98, style=dashed, tooltip="));
}

TEST(ViewGraphText, EmptyGraph) {
  EXPECT_TRUE(nlohmann::json::parse(ViewGraphToJson({}, {}))["edges"].empty());
  EXPECT_THAT(ViewGraphToDot({}, {}), HasSubstr("graph view_graph {"));
}

}  // namespace
}  // namespace cairn
