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

std::set<image_t> FindHinged(StageContext& context, const ViewGraph& graph,
                             const Reconstruction& model) {
  ModelStage stage(context, "hinged_parts");
  const ImageNodes images(model.images);
  const std::vector<std::vector<int>> parts =
      HingedParts(images.size(), FindJoined(context, graph, model, images));
  std::set<image_t> hinged;
  for (auto part = parts.rbegin(); part != parts.rend(); ++part) {
    if (2 * (hinged.size() + part->size()) >= model.images.size()) break;
    hinged.merge(images.ImagesOf(*part));
  }
  stage.Add("parts", parts.size());
  stage.Add("images", hinged.size());
  return hinged;
}

std::vector<std::set<image_t>> FindApart(const ViewGraph& graph, const Reconstruction& model) {
  const ImageNodes images(model.images);
  std::vector<GraphEdge> joined;
  for (const ViewEdge& edge : graph.edges) {
    if (edge.IsActive() && IsWithin(edge, model)) joined.push_back(images.EdgeOf(edge));
  }
  for (const auto& [id, point] : model.points3D) {
    for (const TrackElement& element : point.track) {
      joined.push_back(images.EdgeOf(point.track.front().image_id, element.image_id));
    }
  }
  std::vector<std::set<image_t>> parts = images.ConnectedBy(joined);
  if (!parts.empty()) parts.erase(parts.begin());
  return parts;
}

}  // namespace cairn
