#include "cairn/scene/view_graph.h"

#include <algorithm>
#include <iterator>

#include "cairn/base/check.h"

namespace cairn {

std::string_view EdgeRemovalName(EdgeRemoval removal) {
  constexpr std::string_view kNames[] = {"in_use",
                                         "too_few_inliers",
                                         "no_pose",
                                         "triplet_inconsistent",
                                         "rotation_inconsistent",
                                         "direction_inconsistent",
                                         "other_component",
                                         "ambiguous",
                                         "model_inconsistent"};
  const auto index = static_cast<size_t>(removal);
  return index < std::size(kNames) ? kNames[index] : "unknown";
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
