#pragma once

#include <set>
#include <span>
#include <vector>

#include "cairn/scene/view_graph.h"
#include "graph/graph.h"
#include "math/sorted_order.h"

namespace cairn {

// Images as nodes 0, 1, ... of a graph, in the order of their ids.
class ImageNodes {
 public:
  // Of a map by image id.
  template <class ById>
  explicit ImageNodes(const ById& by_id) {
    for (const auto& [id, value] : by_id) ids_.push_back(id);
  }

  int size() const { return static_cast<int>(ids_.size()); }
  GraphEdge EdgeOf(const ViewEdge& edge) const {
    return {IndexIn(ids_, edge.image_id1), IndexIn(ids_, edge.image_id2)};
  }
  std::set<image_t> ImagesOf(std::span<const int> nodes) const {
    std::set<image_t> images;
    for (const int node : nodes) images.insert(ids_[node]);
    return images;
  }

 private:
  std::vector<image_t> ids_;
};

}  // namespace cairn
