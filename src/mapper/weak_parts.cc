#include <algorithm>

#include "graph/graph.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Matches of which the model made one point.
int NumSharedPoints(const ViewEdge& edge, const FeatureMatches& matches,
                    const Reconstruction& model) {
  const std::vector<point3D_t>& points1 = model.images.at(edge.image_id1).point3D_ids;
  const std::vector<point3D_t>& points2 = model.images.at(edge.image_id2).point3D_ids;
  int num_shared = 0;
  for (const FeatureMatch& match : matches) {
    const point3D_t point = points1[match.point1];
    num_shared += point != kInvalidPoint3DId && point == points2[match.point2];
  }
  return num_shared;
}

// The model's images, and the pairs of them that share as many points as resection asks for.
struct JoinedImages {
  std::vector<image_t> ids;
  std::vector<GraphEdge> pairs;
};

JoinedImages FindJoined(const StageContext& context, const ViewGraph& graph,
                        const Reconstruction& model) {
  JoinedImages joined;
  std::map<image_t, int> index;
  for (const auto& [id, image] : model.images) {
    index[id] = static_cast<int>(joined.ids.size());
    joined.ids.push_back(id);
  }
  for (const ViewEdge& edge : graph.edges) {
    if (!IsWithin(edge, model)) continue;
    if (NumSharedPoints(edge, context.scene.matches.at(edge.PairId()), model) <
        context.settings.resection.min_num_inliers) {
      continue;
    }
    joined.pairs.push_back({index.at(edge.image_id1), index.at(edge.image_id2)});
  }
  return joined;
}

std::set<image_t> IdsOf(const std::vector<int>& part, const JoinedImages& joined) {
  std::set<image_t> ids;
  for (const int i : part) ids.insert(joined.ids[i]);
  return ids;
}

}  // namespace

WeakParts FindWeakParts(StageContext& context, const ViewGraph& graph,
                        const Reconstruction& model) {
  ModelStage stage(context, "weak_parts");
  const JoinedImages joined = FindJoined(context, graph, model);
  const auto num_images = static_cast<int>(joined.ids.size());
  WeakParts weak;
  const GraphComponents components = ConnectedComponents(num_images, joined.pairs);
  for (int c = 1; c < components.Num() && components.nodes[c].size() > 1; ++c) {
    weak.loose.push_back(IdsOf(components.nodes[c], joined));
  }
  const std::vector<std::vector<int>> hinged = HingedParts(num_images, joined.pairs);
  for (auto part = hinged.rbegin(); part != hinged.rend(); ++part) {
    if (2 * (weak.hinged.size() + part->size()) >= joined.ids.size()) break;
    weak.hinged.merge(IdsOf(*part, joined));
  }
  stage.Add("loose", weak.loose.size());
  stage.Add("hinged", hinged.size());
  stage.Add("images_hinged", weak.hinged.size());
  return weak;
}

int MostSharedPoints(const std::set<image_t>& part, const Reconstruction& model) {
  int most = 0;
  for (const image_t id : part) {
    std::map<image_t, int> num_shared;  // by the image outside
    for (const point3D_t point : model.images.at(id).point3D_ids) {
      if (point == kInvalidPoint3DId) continue;
      for (const TrackElement& other : model.points3D.at(point).track) {
        if (part.count(other.image_id) == 0) most = std::max(most, ++num_shared[other.image_id]);
      }
    }
  }
  return most;
}

}  // namespace cairn
