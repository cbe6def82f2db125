#include <algorithm>
#include <cstdint>

#include "cairn/base/parallel.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "view_graph/active_edges.h"

namespace cairn {
namespace {

constexpr int kMaxLoops = 64;  // of an edge that are looked at
constexpr int kGrain = 64;

// The rotation of an edge towards one of its images.
Eigen::Quaterniond RotationTo(const ViewEdge& edge, image_t image) {
  const Eigen::Quaterniond& R = edge.cam2_from_cam1.rotation;
  return edge.image_id2 == image ? R : R.conjugate();
}

// The loops of three through each active edge, and how well they close.
class Triplets {
 public:
  Triplets(const ViewGraph& graph, double max_error_deg, int num_threads)
      : graph_(graph), active_(graph), loops_of_(active_.edges.size()) {
    const LoopFinder finder(static_cast<int>(graph.image_ids.size()), active_.edges);
    ParallelFor(
        num_threads, static_cast<int64_t>(loops_of_.size()),
        [&](int64_t e) {
          const auto [node1, node2] = active_.edges[e];
          for (const LoopFinder::Corner& corner : finder.Find(node1, node2, kMaxLoops)) {
            const double error_deg =
                LoopErrorDeg(Edge(static_cast<int>(e)), Edge(corner.edge1), Edge(corner.edge2));
            loops_of_[e].push_back(
                {corner.edge1, corner.edge2, error_deg, error_deg <= max_error_deg});
          }
        },
        kGrain);
    for (const std::vector<Loop>& loops : loops_of_) {
      num_closed_.push_back(static_cast<int>(
          std::count_if(loops.begin(), loops.end(), [](const Loop& loop) { return loop.closes; })));
    }
  }

  struct Loop {
    int edge1, edge2;  // the other two
    double error_deg;
    bool closes;
  };
  int NumEdges() const { return static_cast<int>(loops_of_.size()); }
  const std::vector<Loop>& LoopsOf(int e) const { return loops_of_[e]; }
  int NumClosed(int e) const { return num_closed_[e]; }
  // Share of its loops that close.
  double Agreement(int e) const {
    return loops_of_[e].empty()
               ? 0.0
               : static_cast<double>(num_closed_[e]) / static_cast<double>(loops_of_[e].size());
  }
  int GraphIndex(int e) const { return active_.index[e]; }

 private:
  const ViewEdge& Edge(int e) const { return graph_.edges[active_.index[e]]; }

  const ViewGraph& graph_;
  ActiveEdges active_;
  std::vector<std::vector<Loop>> loops_of_;
  std::vector<int> num_closed_;
};

// Should the edge go, and why?
EdgeRemoval Judge(const Triplets& triplets, int e, const ViewGraphBuilderOptions& options) {
  int num_agreeing = 0;
  int num_contradicting = 0;
  bool is_contradicted = false;
  for (const Triplets::Loop& loop : triplets.LoopsOf(e)) {
    const int support = std::min(triplets.NumClosed(loop.edge1), triplets.NumClosed(loop.edge2));
    const double agreement =
        std::min(triplets.Agreement(loop.edge1), triplets.Agreement(loop.edge2));
    if (loop.closes) {
      ++num_agreeing;
    } else if (support > 0) {
      is_contradicted = true;
      if (support > triplets.NumClosed(e) && agreement > triplets.Agreement(e)) {
        ++num_contradicting;
      }
    }
  }
  if (num_agreeing == 0) {
    const bool removed = options.filter_triplets && is_contradicted;
    return removed ? EdgeRemoval::kTripletInconsistent : EdgeRemoval::kNone;
  }
  const int num_judges = num_agreeing + num_contradicting;
  const bool removed = options.filter_ambiguous &&
                       num_contradicting >= options.min_contradicting_loops &&
                       num_agreeing < options.min_loop_agreement * num_judges;
  return removed ? EdgeRemoval::kAmbiguous : EdgeRemoval::kNone;
}

}  // namespace

double LoopErrorDeg(const ViewEdge& edge, const ViewEdge& from_first, const ViewEdge& from_second) {
  const image_t third =
      from_first.image_id1 == edge.image_id1 ? from_first.image_id2 : from_first.image_id1;
  const Eigen::Quaterniond detour =
      RotationTo(from_second, edge.image_id2) * RotationTo(from_first, third);
  return RadToDeg(AngleBetween(detour, RotationTo(edge, edge.image_id2)));
}

LoopReport RemoveInconsistentTriplets(ViewGraph& graph, const ViewGraphBuilderOptions& options,
                                      const RunContext& run) {
  const Triplets triplets(graph, options.max_triplet_error_deg, run.num_threads);
  LoopReport report;
  std::vector<double> errors_deg;
  std::vector<EdgeRemoval> verdicts;
  for (int e = 0; e < triplets.NumEdges(); ++e) {
    for (const Triplets::Loop& loop : triplets.LoopsOf(e)) errors_deg.push_back(loop.error_deg);
    report.num_loops += static_cast<int64_t>(triplets.LoopsOf(e).size());
    report.num_closed += triplets.NumClosed(e);
    verdicts.push_back(Judge(triplets, e, options));
  }
  report.median_error_deg = UpperMedian(std::move(errors_deg));
  for (int e = 0; e < triplets.NumEdges(); ++e) {
    if (verdicts[e] != EdgeRemoval::kNone)
      graph.edges[triplets.GraphIndex(e)].removal = verdicts[e];
  }
  return report;
}

}  // namespace cairn
