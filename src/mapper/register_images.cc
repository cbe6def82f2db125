#include <algorithm>

#include "mapper/stages.h"

namespace cairn {
namespace {

// Points that an image's keypoints show, by matches with registered images.
struct Correspondences {
  std::vector<point2D_t> keypoints;
  std::vector<point3D_t> points;
};

// Pairs of images outside the model with images in it, by the former.
using PairsOfOutsiders = std::map<image_t, std::vector<const ViewEdge*>>;
PairsOfOutsiders FindPairsOfOutsiders(const ViewGraph& graph, const Reconstruction& model) {
  PairsOfOutsiders pairs;
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
  std::map<point2D_t, std::map<point3D_t, int>> votes;
  for (const ViewEdge* edge : edges) {
    const bool is_first = edge->image_id1 == image_id;
    const auto other = model.images.find(is_first ? edge->image_id2 : edge->image_id1);
    for (const FeatureMatch& match : scene.matches.at(edge->PairId())) {
      const point2D_t keypoint = is_first ? match.point1 : match.point2;
      const point3D_t point = other->second.point3D_ids[is_first ? match.point2 : match.point1];
      if (point != kInvalidPoint3DId) ++votes[keypoint][point];
    }
  }
  Correspondences result;
  for (const auto& [keypoint, counts] : votes) {
    const auto best =
        std::max_element(counts.begin(), counts.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    result.keypoints.push_back(keypoint);
    result.points.push_back(best->first);
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

void AddImage(const StageContext& context, const ResectionReport& report, image_t image_id,
              Reconstruction& model) {
  RegisteredImage image;
  image.image = context.scene.images.at(image_id);
  image.cam_from_world = report.cam_from_world;
  image.points2D = context.scene.pixels.at(image_id);
  image.point3D_ids.assign(image.points2D.size(), kInvalidPoint3DId);
  model.cameras.try_emplace(image.image.camera_id, report.camera);
  model.images[image_id] = std::move(image);
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
  int num_registered = 0;
  for (const auto& [negative_count, id] : candidates) {
    const ResectionReport report = Resect(context, correspondences.at(id), model, id);
    const std::string what = context.scene.images.at(id).name + ": " +
                             std::to_string(report.inliers.size()) + " of " +
                             std::to_string(-negative_count) + " points agree";
    if (report.status != ResectionStatus::kSuccess) {
      stage.Note(what + ", not registered (" + std::string(ResectionStatusName(report.status)) +
                 ")");
      continue;
    }
    stage.Note(what + ", registered by resection");
    AddImage(context, report, id, model);
    ++num_registered;
  }
  stage.Add("candidates", candidates.size());
  stage.Add("registered", num_registered);
  return num_registered;
}

}  // namespace cairn
