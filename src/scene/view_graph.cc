#include "cairn/scene/view_graph.h"

#include <algorithm>

#include "cairn/base/check.h"

namespace cairn {

std::string_view EdgeRemovalName(EdgeRemoval removal) {
  switch (removal) {
    case EdgeRemoval::kNone:
      return "in_use";
    case EdgeRemoval::kTooFewInliers:
      return "too_few_inliers";
    case EdgeRemoval::kNoPose:
      return "no_pose";
    case EdgeRemoval::kTripletInconsistent:
      return "triplet_inconsistent";
    case EdgeRemoval::kRotationInconsistent:
      return "rotation_inconsistent";
    case EdgeRemoval::kDirectionInconsistent:
      return "direction_inconsistent";
    case EdgeRemoval::kOtherComponent:
      return "other_component";
    case EdgeRemoval::kAmbiguous:
      return "ambiguous";
    case EdgeRemoval::kWeakBridge:
      return "weak_bridge";
    case EdgeRemoval::kModelInconsistent:
      return "model_inconsistent";
  }
  return "unknown";
}

int ViewGraph::NumActiveEdges() const {
  return static_cast<int>(
      std::count_if(edges.begin(), edges.end(), [](const ViewEdge& e) { return e.IsActive(); }));
}

void ViewGraph::Normalize() {
  std::sort(image_ids.begin(), image_ids.end());
  image_ids.erase(std::unique(image_ids.begin(), image_ids.end()), image_ids.end());
  std::sort(edges.begin(), edges.end(),
            [](const ViewEdge& a, const ViewEdge& b) { return a.PairId() < b.PairId(); });
  for (size_t i = 0; i < edges.size(); ++i) {
    CAIRN_CHECK_LT(edges[i].image_id1, edges[i].image_id2);
    CAIRN_CHECK(std::binary_search(image_ids.begin(), image_ids.end(), edges[i].image_id1));
    CAIRN_CHECK(std::binary_search(image_ids.begin(), image_ids.end(), edges[i].image_id2));
    if (i > 0) CAIRN_CHECK_NE(edges[i - 1].PairId(), edges[i].PairId());
  }
}

}  // namespace cairn
