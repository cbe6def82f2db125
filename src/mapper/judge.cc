#include <algorithm>

#include "mapper/stages.h"

namespace cairn {
namespace {

const FeatureMatches kNoMatches;

}  // namespace

ModelEvidence EvidenceFor(const StageContext& context, const Reconstruction& model,
                          const ViewGraph& graph) {
  std::vector<VerifiedPair> pairs;
  for (const ViewEdge& edge : graph.edges) {
    const bool is_of_others =
        context.taken.count(edge.image_id1) > 0 || context.taken.count(edge.image_id2) > 0;
    pairs.push_back({edge.image_id1, edge.image_id2,
                     is_of_others ? &kNoMatches : &context.scene.matches.at(edge.PairId())});
  }
  return EvaluateEvidence(model, pairs, context.run);
}

int64_t ReviseEdges(const ModelEvidence& evidence, const Reconstruction& model, ViewGraph& graph) {
  int64_t num_gained = 0;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    ViewEdge& edge = graph.edges[e];
    const Support& support = evidence.pairs[e];
    if (edge.removal == EdgeRemoval::kAmbiguous || support.num_matches == 0 ||
        model.images.count(edge.image_id1) == 0 || model.images.count(edge.image_id2) == 0) {
      continue;
    }
    if (support.IsContradicted()) {
      if (edge.IsActive()) edge.removal = EdgeRemoval::kModelInconsistent;
    } else if (!edge.IsActive()) {
      edge.removal = EdgeRemoval::kNone;
      num_gained += support.num_explained;
    }
  }
  return num_gained;
}

}  // namespace cairn
