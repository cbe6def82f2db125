#include <algorithm>

#include "mapper/image_nodes.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// The pairs of images that share as many points as resection asks for.
std::vector<GraphEdge> FindJoined(const StageContext& context, const ViewGraph& graph,
                                  const Reconstruction& model, const ImageNodes& images) {
  std::vector<GraphEdge> joined;
  for (const ViewEdge& edge : graph.edges) {
    if (!IsWithin(edge, model)) continue;
    const int num_shared = NumSharedPoints(edge, context.scene.matches.at(edge.PairId()), model);
    if (num_shared < context.settings.resection.min_num_inliers) continue;
    joined.push_back(images.EdgeOf(edge));
  }
  return joined;
}

}  // namespace

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

WeakParts FindWeakParts(StageContext& context, const ViewGraph& graph,
                        const Reconstruction& model) {
  ModelStage stage(context, "weak_parts");
  const ImageNodes images(model.images);
  const std::vector<GraphEdge> joined = FindJoined(context, graph, model, images);
  WeakParts weak;
  const GraphComponents components = ConnectedComponents(images.size(), joined);
  for (int c = 1; c < components.Num() && components.nodes[c].size() > 1; ++c) {
    weak.loose.push_back(images.ImagesOf(components.nodes[c]));
  }
  const std::vector<std::vector<int>> hinged = HingedParts(images.size(), joined);
  for (auto part = hinged.rbegin(); part != hinged.rend(); ++part) {
    if (2 * (weak.hinged.size() + part->size()) >= model.images.size()) break;
    weak.hinged.merge(images.ImagesOf(*part));
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
