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

}  // namespace

std::set<image_t> FindHinged(StageContext& context, const ViewGraph& graph,
                             const Reconstruction& model) {
  ModelStage stage(context, "hinged");
  std::vector<image_t> images;
  std::map<image_t, int> index;
  for (const auto& [id, image] : model.images) {
    index[id] = static_cast<int>(images.size());
    images.push_back(id);
  }
  std::vector<GraphEdge> joined;
  for (const ViewEdge& edge : graph.edges) {
    if (!IsWithin(edge, model)) continue;
    if (NumSharedPoints(edge, context.scene.matches.at(edge.PairId()), model) <
        context.settings.resection.min_num_inliers) {
      continue;
    }
    joined.push_back({index.at(edge.image_id1), index.at(edge.image_id2)});
  }
  const std::vector<std::vector<int>> parts = HingedParts(static_cast<int>(images.size()), joined);
  std::set<image_t> hinged;
  for (auto part = parts.rbegin(); part != parts.rend(); ++part) {
    if (2 * (hinged.size() + part->size()) >= images.size()) break;
    for (const int i : *part) hinged.insert(images[i]);
  }
  stage.Add("parts", parts.size());
  stage.Add("images", hinged.size());
  return hinged;
}

}  // namespace cairn
