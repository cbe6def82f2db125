#include <algorithm>
#include <bit>
#include <cstdint>

#include "cairn/base/parallel.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "view_graph/active_edges.h"

namespace cairn {
namespace {

constexpr int kMaxLoops = 64;  // of an edge that are looked at: the bits of a word
constexpr int kGrain = 64;

// The rotation of an edge towards one of its images.
Eigen::Quaterniond RotationTo(const ViewEdge& edge, image_t image) {
  const Eigen::Quaterniond& R = edge.cam2_from_cam1.rotation;
  return edge.image_id2 == image ? R : R.conjugate();
}

// The loops of three through each active edge, and which of them close.
class Triplets {
 public:
  Triplets(const ViewGraph& graph, double max_error_deg, int num_threads)
      : active_(graph),
        finders_(EffectiveNumThreads(num_threads),
                 LoopFinder(static_cast<int>(graph.image_ids.size()), active_.edges)),
        num_loops_(active_.edges.size()),
        closes_(active_.edges.size()) {
    ParallelForWorker(
        num_threads, NumEdges(),
        [&](int worker, int64_t e) {
          const auto edge = [&](int64_t k) -> const ViewEdge& {
            return graph.edges[active_.index[k]];
          };
          const auto corners = CornersOf(static_cast<int>(e), worker);
          num_loops_[e] = static_cast<int>(corners.size());
          for (size_t k = 0; k < corners.size(); ++k) {
            if (LoopErrorDeg(edge(e), edge(corners[k].edge1), edge(corners[k].edge2)) <=
                max_error_deg) {
              closes_[e] |= uint64_t{1} << k;
            }
          }
        },
        kGrain);
  }

  int NumEdges() const { return static_cast<int>(closes_.size()); }
  // Their bits in Closes are in this order.
  std::vector<LoopFinder::Corner> CornersOf(int e, int worker) {
    return finders_[worker].Find(active_.edges[e].node1, active_.edges[e].node2, kMaxLoops);
  }
  uint64_t Closes(int e) const { return closes_[e]; }
  int NumLoops(int e) const { return num_loops_[e]; }
  int NumClosed(int e) const { return std::popcount(closes_[e]); }
  // Share of its loops that close.
  double Agreement(int e) const {
    return num_loops_[e] == 0 ? 0.0 : static_cast<double>(NumClosed(e)) / num_loops_[e];
  }
  int GraphIndex(int e) const { return active_.index[e]; }

 private:
  ActiveEdges active_;
  std::vector<LoopFinder> finders_;  // of each worker
  std::vector<int> num_loops_;
  std::vector<uint64_t> closes_;
};

// Should the edge go, and why?
EdgeRemoval Judge(Triplets& triplets, int e, int worker, const ViewGraphBuilderOptions& options) {
  const int num_agreeing = triplets.NumClosed(e);
  int num_contradicting = 0;
  bool is_contradicted = false;
  const auto corners = triplets.CornersOf(e, worker);
  for (size_t k = 0; k < corners.size(); ++k) {
    if (triplets.Closes(e) >> k & 1) continue;
    const auto [node, edge1, edge2] = corners[k];
    const int support = std::min(triplets.NumClosed(edge1), triplets.NumClosed(edge2));
    if (support == 0) continue;
    is_contradicted = true;
    const double agreement = std::min(triplets.Agreement(edge1), triplets.Agreement(edge2));
    num_contradicting += support > num_agreeing && agreement > triplets.Agreement(e);
  }
  if (num_agreeing == 0) {
    return is_contradicted ? EdgeRemoval::kTripletInconsistent : EdgeRemoval::kNone;
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
  Triplets triplets(graph, options.max_triplet_error_deg, run.num_threads);
  std::vector<EdgeRemoval> verdicts(triplets.NumEdges());
  const auto judge = [&](int worker, int64_t e) {
    verdicts[e] = Judge(triplets, static_cast<int>(e), worker, options);
  };
  ParallelForWorker(run.num_threads, triplets.NumEdges(), judge, kGrain);
  LoopReport report;
  for (int e = 0; e < triplets.NumEdges(); ++e) {
    report.num_loops += triplets.NumLoops(e);
    report.num_closed += triplets.NumClosed(e);
  }
  for (int e = 0; e < triplets.NumEdges(); ++e) {
    if (verdicts[e] != EdgeRemoval::kNone)
      graph.edges[triplets.GraphIndex(e)].removal = verdicts[e];
  }
  return report;
}

}  // namespace cairn
