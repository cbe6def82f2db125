#include "cairn/view_graph/view_graph_builder.h"

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/poses.h"
#include "cairn/synthetic/view_graph_problem.h"
#include "support/test.h"

namespace cairn {
namespace {

// Images 1 .. n with random rotations; edges are exact.
struct Rig {
  explicit Rig(int n, uint64_t seed = 1) {
    Rng rng(seed);
    for (int k = 1; k <= n; ++k) {
      ids.push_back(k);
      truth[k] = RandomRotation(rng);
    }
  }
  void Add(image_t a, image_t b, int num_inliers = 100, double error_deg = 0) {
    ViewEdge edge;
    edge.image_id1 = std::min(a, b);
    edge.image_id2 = std::max(a, b);
    edge.cam2_from_cam1.rotation = ExpSO3({0, DegToRad(error_deg), 0}) * truth[edge.image_id2] *
                                   truth[edge.image_id1].conjugate();
    edge.cam2_from_cam1.translation = Eigen::Vector3d::UnitX();
    edge.num_inliers = num_inliers;
    edges.push_back(edge);
  }
  void AddComplete(image_t first, image_t last) {
    for (image_t a = first; a <= last; ++a) {
      for (image_t b = a + 1; b <= last; ++b) Add(a, b);
    }
  }
  ViewGraphResult Build(const ViewGraphBuilderOptions& options = {}) const {
    return BuildViewGraph(ids, edges, options);
  }
  std::vector<image_t> ids;
  std::map<image_t, Eigen::Quaterniond> truth;
  std::vector<ViewEdge> edges;
};

EdgeRemoval RemovalOf(const ViewGraphResult& result, image_t a, image_t b) {
  for (const ViewEdge& e : result.graph.edges) {
    if (e.image_id1 == a && e.image_id2 == b) return e.removal;
  }
  ADD_FAILURE() << "no edge " << a << " " << b;
  return EdgeRemoval::kNone;
}

TEST(ViewGraphBuilder, KeepsAConsistentGraph) {
  Rig rig(6);
  rig.AddComplete(1, 6);
  const ViewGraphResult result = rig.Build();
  EXPECT_EQ(result.report.num_active_edges, 15);
  EXPECT_EQ(result.report.loops.num_loops, 15 * 4);
  EXPECT_EQ(result.report.loops.num_closed, 15 * 4);
  EXPECT_THAT(result.report.components, ElementsAre(ElementsAre(1, 2, 3, 4, 5, 6)));
}

TEST(ViewGraphBuilder, EmptyGraphAndImagesWithoutEdges) {
  EXPECT_EQ(BuildViewGraph({}, {}).report.num_edges, 0);
  const ViewGraphResult result = BuildViewGraph({3, 1}, {});
  EXPECT_THAT(result.graph.image_ids, ElementsAre(1, 3));
  EXPECT_THAT(result.report.components, IsEmpty());
}

TEST(ViewGraphBuilder, DropsPairsWithFewInliersAndKeepsGivenReasons) {
  Rig rig(3);
  rig.AddComplete(1, 3);
  rig.edges[0].num_inliers = 14;
  rig.edges[1].removal = EdgeRemoval::kNoPose;
  const ViewGraphResult result = rig.Build();
  EXPECT_EQ(RemovalOf(result, 1, 2), EdgeRemoval::kTooFewInliers);
  EXPECT_EQ(RemovalOf(result, 1, 3), EdgeRemoval::kNoPose);
  EXPECT_EQ(RemovalOf(result, 2, 3), EdgeRemoval::kNone);
  EXPECT_EQ(result.report.num_removed.at(EdgeRemoval::kTooFewInliers), 1);
  EXPECT_EQ(result.report.num_removed.at(EdgeRemoval::kNoPose), 1);
  ViewGraphBuilderOptions options;
  options.min_num_inliers = 14;
  EXPECT_EQ(RemovalOf(rig.Build(options), 1, 2), EdgeRemoval::kNone);
}

TEST(ViewGraphBuilder, KeepsPairsOfADataSetWhoseInliersNobodyCounted) {
  Rig rig(3);
  rig.AddComplete(1, 3);
  for (ViewEdge& edge : rig.edges) edge.num_inliers = 0;
  rig.edges[0].source = EdgeSource::kDataset;
  const ViewGraphResult result = rig.Build();
  EXPECT_EQ(RemovalOf(result, 1, 2), EdgeRemoval::kNone);
  EXPECT_EQ(RemovalOf(result, 1, 3), EdgeRemoval::kTooFewInliers);
}

TEST(ViewGraphBuilder, DropsAnEdgeThatClosesInNoLoop) {
  Rig rig(5);
  rig.AddComplete(1, 5);
  rig.edges[0] = {};  // replaced by a wrong one
  rig.edges.erase(rig.edges.begin());
  rig.Add(1, 2, 5000, 20);
  const ViewGraphResult result = rig.Build();
  EXPECT_EQ(RemovalOf(result, 1, 2), EdgeRemoval::kTripletInconsistent);
  EXPECT_EQ(result.report.num_active_edges, 9);

  ViewGraphBuilderOptions loose;
  loose.max_triplet_error_deg = 25;
  EXPECT_EQ(RemovalOf(rig.Build(loose), 1, 2), EdgeRemoval::kNone);
  ViewGraphBuilderOptions off;
  off.max_triplet_error_deg = 180;
  EXPECT_EQ(RemovalOf(rig.Build(off), 1, 2), EdgeRemoval::kNone);
}

TEST(ViewGraphBuilder, OfALonelyLoopNobodyKnowsTheWrongEdge) {
  Rig rig(3);
  rig.Add(1, 2);
  rig.Add(2, 3);
  rig.Add(1, 3, 100, 40);
  EXPECT_EQ(rig.Build().report.num_active_edges, 3);
}

// Images 1 .. 8 and 9 .. 16 see two copies of a facade. Wrong pairs between 1, 2 and 9, 10 agree
// with each other, but correct pairs through 17 .. 20 contradict them, however many inliers they
// have.
TEST(ViewGraphBuilder, DropsPairsOfRepeatedStructure) {
  Rig rig(20);
  for (image_t a = 1; a <= 20; ++a) {
    for (image_t b = a + 1; b <= 20; ++b) {
      const bool is_wrong = a <= 2 && (b == 9 || b == 10);
      if (is_wrong) {
        // All four tell the same story: the second facade is where the first one is.
        ViewEdge edge;
        edge.image_id1 = a;
        edge.image_id2 = b;
        edge.cam2_from_cam1.rotation =
            rig.truth[b] * ExpSO3({0, 2.0, 0}) * rig.truth[a].conjugate();
        edge.num_inliers = 1000;
        rig.edges.push_back(edge);
      } else {
        rig.Add(a, b, 50);
      }
    }
  }
  const ViewGraphResult result = rig.Build();
  EXPECT_EQ(result.report.num_removed.at(EdgeRemoval::kAmbiguous), 4);
  EXPECT_EQ(RemovalOf(result, 2, 10), EdgeRemoval::kAmbiguous);
  EXPECT_EQ(result.report.num_removed.size(), 1u);

  ViewGraphBuilderOptions options;
  options.filter_ambiguous = false;
  EXPECT_EQ(RemovalOf(rig.Build(options), 2, 10), EdgeRemoval::kNone);
  options = {};
  options.min_contradicting_loops = 100;
  EXPECT_EQ(RemovalOf(rig.Build(options), 2, 10), EdgeRemoval::kNone);
  options = {};
  options.min_loop_agreement = 0.01;
  EXPECT_EQ(RemovalOf(rig.Build(options), 2, 10), EdgeRemoval::kNone);
}

TEST(ViewGraphBuilder, RemovesWhatGlobalRotationsContradict) {
  Rig rig(4);
  rig.Add(1, 2, 100, 9);
  rig.Add(2, 3, 100, 11);
  rig.Add(3, 4);
  ViewGraph graph = rig.Build().graph;
  std::map<image_t, Eigen::Quaterniond> rotations = rig.truth;
  rotations.erase(4);
  EXPECT_EQ(RemoveRotationOutliers(rotations, 10, graph), 2);
  EXPECT_TRUE(graph.edges[0].IsActive());
  EXPECT_EQ(graph.edges[1].removal, EdgeRemoval::kRotationInconsistent);
  EXPECT_EQ(graph.edges[2].removal, EdgeRemoval::kRotationInconsistent);
}

TEST(ViewGraphBuilder, KeepsOnlyTheGivenImages) {
  Rig rig(5);
  rig.AddComplete(1, 5);
  ViewGraph graph = rig.Build().graph;
  const std::vector<image_t> kept = {5, 2, 4};
  KeepImages(kept, graph);
  EXPECT_THAT(ActiveComponents(graph), ElementsAre(ElementsAre(2, 4, 5)));
}

TEST(ViewGraphBuilder, OnNoisyLandmarksOutliersGoAndGoodPairsStay) {
  ViewGraphOptions scene;
  scene.num_images = 100;
  scene.num_edges = 2000;
  scene.outlier_ratio = 0.2;
  const ViewGraphProblem problem = MakeViewGraphProblem(scene, 3);
  ViewGraphBuilderOptions options;
  options.min_num_inliers = 0;
  ViewGraphResult results[2];
  for (const int num_threads : {1, 8}) {
    results[num_threads > 1] = BuildViewGraph(problem.graph.image_ids, problem.graph.edges, options,
                                              {.num_threads = num_threads});
  }
  int num_outliers_kept = 0, num_good_lost = 0;
  for (size_t e = 0; e < problem.graph.edges.size(); ++e) {
    const bool kept = results[0].graph.edges[e].IsActive();
    EXPECT_EQ(results[0].graph.edges[e].removal, results[1].graph.edges[e].removal);
    num_outliers_kept += kept && problem.is_outlier[e];
    num_good_lost += !kept && !problem.is_outlier[e];
  }
  EXPECT_LE(num_outliers_kept, 40);  // of 400
  EXPECT_LE(num_good_lost, 16);      // of 1600
}

TEST(ViewGraphBuilder, RefusesBrokenInput) {
  Rig rig(3);
  rig.Add(1, 2);
  EXPECT_THROW(BuildViewGraph({1}, rig.edges), BugError);
  rig.Add(1, 2);
  EXPECT_THROW(rig.Build(), BugError);
  ViewGraphBuilderOptions options;
  options.min_loop_agreement = 2;
  EXPECT_THROW(BuildViewGraph({}, {}, options), ConfigError);
}

}  // namespace
}  // namespace cairn
