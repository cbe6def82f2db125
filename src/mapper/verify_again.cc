#include <algorithm>

#include "cairn/geometry/rigid3d.h"
#include "evaluation/model_evidence.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

constexpr size_t kBlock = 4096;  // pairs whose raw matches are in memory at a time

// Do rays at the image's border lie apart by more pixels than two-view verification allows?
bool HasMoved(const Camera& before, const Camera& after) {
  const double max_error_px = DefaultMaxErrorPx(before, after);
  for (const double u : {0.0, 0.5, 1.0}) {
    for (const double v : {0.0, 0.5, 1.0}) {
      const Eigen::Vector2d pixel(u * before.width, v * before.height);
      const auto ray_before = before.RayFromImg(pixel);
      const auto ray_after = after.RayFromImg(pixel);
      if (ray_before.has_value() != ray_after.has_value()) return true;
      if (!ray_before) continue;
      if (AngleBetween(*ray_before, *ray_after) > max_error_px * after.RadiansPerPx(*ray_after)) {
        return true;
      }
    }
  }
  return false;
}

}  // namespace

ReverifiedPairs VerifyAgain(StageContext& context, const Reconstruction& model,
                            const ViewGraph& graph) {
  ReverifiedPairs result;
  std::set<camera_t> moved;
  for (const auto& [id, camera] : model.cameras) {
    if (HasMoved(context.scene.KnownCamera(id), camera)) moved.insert(id);
  }
  if (moved.empty() || !context.scene.raw_matches) return result;
  ModelStage stage(context, "verification");
  std::vector<const ViewEdge*> edges;
  const auto is_moved = [&](image_t id) {
    const auto image = model.images.find(id);
    return image != model.images.end() && moved.contains(image->second.image.camera_id);
  };
  for (const ViewEdge& edge : graph.edges) {
    if (edge.IsActive() && (is_moved(edge.image_id1) || is_moved(edge.image_id2))) {
      edges.push_back(&edge);
    }
  }
  for (size_t begin = 0; begin < edges.size(); begin += kBlock) {
    const size_t end = std::min(edges.size(), begin + kBlock);
    std::vector<FeatureMatches> raw;
    for (size_t e = begin; e < end; ++e) raw.push_back(context.scene.raw_matches(*edges[e]));
    std::vector<VerifiedPair> pairs;
    for (size_t e = begin; e < end; ++e) {
      pairs.push_back({edges[e]->image_id1, edges[e]->image_id2, &raw[e - begin]});
    }
    std::vector<FeatureMatches> explained = ExplainedMatches(model, pairs, context.run);
    for (size_t e = begin; e < end; ++e) {
      const image_pair_t pair_id = edges[e]->PairId();
      const size_t num_before = context.scene.matches.at(pair_id).size();
      if (explained[e - begin].size() <= num_before) continue;
      result.num_gained += static_cast<int64_t>(explained[e - begin].size() - num_before);
      result.matches[pair_id] = std::move(explained[e - begin]);
    }
  }
  stage.Add("cameras_moved", moved.size());
  stage.Add("pairs", edges.size());
  stage.Add("matches_gained", result.num_gained);
  return result;
}

bool TakeIntrinsics(std::span<const Reconstruction> models, const RunContext& run,
                    SceneData& scene) {
  std::set<camera_t> seen = scene.constant_cameras, moved;
  for (const Reconstruction& model : models) {  // the largest that has a camera tells
    for (const auto& [id, image] : model.images) {
      Camera& camera = scene.cameras.at(scene.CameraIdOf(id));
      if (!seen.insert(camera.camera_id).second) continue;
      Camera found = model.CameraOf(image);
      found.camera_id = camera.camera_id;
      found.has_prior_focal_length = camera.has_prior_focal_length;
      if (!HasMoved(camera, found)) continue;
      scene.before_models.try_emplace(camera.camera_id, camera);
      moved.insert(camera.camera_id);
      camera = std::move(found);
    }
  }
  if (moved.empty()) return false;
  ImproveRelativePoses(ReadGeometriesOf(moved, scene), run, scene);
  scene.origin = "the intrinsics of the best models before";
  return true;
}

bool RefineWithMovedIntrinsics(StageContext& context, const ViewGraph& graph,
                               Reconstruction& model) {
  const ReverifiedPairs again = VerifyAgain(context, model, graph);
  if (static_cast<double>(again.num_gained) <= kMinGain * model.NumObservations()) return true;
  Reconstruction other = model;
  if (!FitAndRefine(context, TracksOfGraph(context, graph, again.matches).tracks,
                    RefineStart::kRefined, other)) {
    return false;
  }
  if (other.images.size() == model.images.size()) model = std::move(other);
  return true;
}

}  // namespace cairn
