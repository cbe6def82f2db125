#include <algorithm>

#include "base/text.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Points that an image's keypoints show, by matches with registered images.
struct Correspondences {
  std::vector<point2D_t> keypoints;
  std::vector<point3D_t> points;
};

// Pairs of an image in the model and one outside, by the one outside.
std::map<image_t, std::vector<const ViewEdge*>> FindPairsOfOutsiders(const ViewGraph& graph,
                                                                     const Reconstruction& model) {
  std::map<image_t, std::vector<const ViewEdge*>> pairs;
  for (const ViewEdge& edge : graph.edges) {
    if (edge.removal == EdgeRemoval::kAmbiguous) continue;  // leads to another place
    const bool has_first = model.images.count(edge.image_id1) > 0;
    if (has_first == (model.images.count(edge.image_id2) > 0)) continue;
    pairs[has_first ? edge.image_id2 : edge.image_id1].push_back(&edge);
  }
  return pairs;
}

// For every keypoint the point that most of its matches show; of equal ones the smallest id.
Correspondences FindCorrespondences(const SceneData& scene,
                                    const std::vector<const ViewEdge*>& edges,
                                    const Reconstruction& model, image_t image_id) {
  std::vector<std::pair<point2D_t, point3D_t>> votes;
  for (const ViewEdge* edge : edges) {
    const bool is_first = edge->image_id1 == image_id;
    const auto other = model.images.find(is_first ? edge->image_id2 : edge->image_id1);
    for (const FeatureMatch& match : scene.matches.at(edge->PairId())) {
      const point3D_t point = other->second.point3D_ids[is_first ? match.point2 : match.point1];
      if (point == kInvalidPoint3DId) continue;
      votes.emplace_back(is_first ? match.point1 : match.point2, point);
    }
  }
  std::sort(votes.begin(), votes.end());
  Correspondences result;
  size_t most = 0;
  for (auto begin = votes.begin(), end = begin; begin != votes.end(); begin = end) {
    end = std::find_if(begin, votes.end(), [&](const auto& vote) { return vote != *begin; });
    const size_t num = end - begin;
    const bool is_other = result.keypoints.empty() || result.keypoints.back() != begin->first;
    if (!is_other && num <= most) continue;
    if (is_other) {
      result.keypoints.push_back(begin->first);
      result.points.emplace_back();
    }
    result.points.back() = begin->second;
    most = num;
  }
  return result;
}

ResectionReport Resect(const StageContext& context, const Correspondences& correspondences,
                       const Reconstruction& model, image_t image_id) {
  const Image& image = context.scene.images.at(image_id);
  // A camera that the model has already is known; one that only a guess describes is not.
  const auto known = model.cameras.find(image.camera_id);
  const Camera& camera =
      known != model.cameras.end() ? known->second : context.scene.cameras.at(image.camera_id);
  const bool is_guess = known == model.cameras.end() && !camera.has_prior_focal_length &&
                        context.scene.constant_cameras.count(image.camera_id) == 0;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<Eigen::Vector3d> xyz;
  for (size_t i = 0; i < correspondences.points.size(); ++i) {
    pixels.push_back(context.scene.pixels.at(image_id)[correspondences.keypoints[i]]);
    xyz.push_back(model.points3D.at(correspondences.points[i]).xyz);
  }
  return EstimateAbsolutePose(camera, {pixels, xyz}, is_guess, context.settings.resection,
                              Rng(context.run.seed, "resection", image_id));
}

}  // namespace

int RegisterLeftOut(StageContext& context, const ViewGraph& graph, Reconstruction& model) {
  ModelStage stage(context, "registration");
  // The images with the most points first: they are the surest, and add nothing that others need.
  std::vector<std::pair<int64_t, image_t>> candidates;
  std::map<image_t, Correspondences> correspondences;
  for (const auto& [id, edges] : FindPairsOfOutsiders(graph, model)) {
    if (context.taken.count(id) > 0 || context.reserved.count(id) > 0) continue;
    Correspondences found = FindCorrespondences(context.scene, edges, model, id);
    if (static_cast<int>(found.points.size()) < context.settings.resection.min_num_inliers) {
      continue;
    }
    candidates.emplace_back(-static_cast<int64_t>(found.points.size()), id);
    correspondences[id] = std::move(found);
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<std::string> registered, refused;
  for (const auto& [negative_count, id] : candidates) {
    const ResectionReport report = Resect(context, correspondences.at(id), model, id);
    const std::string what = context.scene.images.at(id).name + " (" +
                             std::to_string(report.inliers.size()) + " of " +
                             std::to_string(-negative_count) + " points agree)";
    if (report.status == ResectionStatus::kSuccess) {
      AddImage(context.scene, id, report.cam_from_world, report.camera, model);
      registered.push_back(what);
    } else {
      refused.push_back(what);
    }
  }
  if (!registered.empty()) stage.Record("registered by resection: " + FirstNames(registered));
  if (!refused.empty()) stage.Record("not registered: " + FirstNames(refused));
  stage.Add("candidates", candidates.size());
  stage.Add("registered", registered.size());
  return static_cast<int>(registered.size());
}

}  // namespace cairn
