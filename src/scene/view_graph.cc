#include "cairn/scene/view_graph.h"

#include <algorithm>
#include <utility>

#include "cairn/base/check.h"
#include "math/sorted_order.h"

namespace cairn {

std::string_view EdgeRemovalName(EdgeRemoval removal) { return NameOf(kEdgeRemovals, removal); }

int ViewGraph::NumActiveEdges() const {
  return static_cast<int>(std::ranges::count_if(edges, &ViewEdge::IsActive));
}

void ViewGraph::Normalize() {
  image_ids = Unique(std::move(image_ids));
  std::ranges::sort(edges, {}, &ViewEdge::PairId);
  for (size_t i = 0; i < edges.size(); ++i) {
    CAIRN_CHECK_LT(edges[i].image_id1, edges[i].image_id2);
    CAIRN_CHECK(std::binary_search(image_ids.begin(), image_ids.end(), edges[i].image_id1));
    CAIRN_CHECK(std::binary_search(image_ids.begin(), image_ids.end(), edges[i].image_id2));
    if (i > 0) CAIRN_CHECK_NE(edges[i - 1].PairId(), edges[i].PairId());
  }
}

}  // namespace cairn
