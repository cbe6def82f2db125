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
  image_t IdOf(int node) const { return ids_[node]; }
  GraphEdge EdgeOf(const ViewEdge& edge) const { return EdgeOf(edge.image_id1, edge.image_id2); }
  GraphEdge EdgeOf(image_t id1, image_t id2) const {
    return {IndexIn(ids_, id1), IndexIn(ids_, id2)};
  }
  // Images that edges connect, the most first.
  std::vector<std::set<image_t>> ConnectedBy(std::span<const GraphEdge> edges) const {
    std::vector<std::set<image_t>> connected;
    for (const std::vector<int>& nodes : ConnectedComponents(size(), edges).nodes) {
      connected.push_back(ImagesOf(nodes));
    }
    return connected;
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
