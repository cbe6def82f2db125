#include <algorithm>

#include "base/first_names.h"
#include "cairn/base/parallel.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Points that an image's keypoints show, by matches with registered images.
struct Correspondences {
  std::vector<point2D_t> keypoints;
  std::vector<point3D_t> points;
};

// Pairs with images in the model, by the other image.
using PairsOfImages = std::map<image_t, std::vector<const ViewEdge*>>;

// Of images outside the model.
PairsOfImages FindPairsOfOutsiders(const ViewGraph& graph, const Reconstruction& model) {
  PairsOfImages pairs;
  for (const ViewEdge& edge : graph.edges) {
    if (edge.removal == EdgeRemoval::kAmbiguous) continue;  // leads to another place
    const bool has_first = model.images.count(edge.image_id1) > 0;
    if (has_first == (model.images.count(edge.image_id2) > 0)) continue;
    pairs[has_first ? edge.image_id2 : edge.image_id1].push_back(&edge);
  }
  return pairs;
}

// Of images in the model.
PairsOfImages FindPairsOfMembers(const ViewGraph& graph, const Reconstruction& model) {
  PairsOfImages pairs;
  for (const ViewEdge& edge : graph.edges) {
    if (!IsWithin(edge, model)) continue;
    pairs[edge.image_id1].push_back(&edge);
    pairs[edge.image_id2].push_back(&edge);
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

// Without the points that only one image beside this one sees.
Correspondences SeenByOthers(const Correspondences& correspondences, const Reconstruction& model,
                             image_t image_id) {
  Correspondences seen;
  for (size_t i = 0; i < correspondences.points.size(); ++i) {
    const auto& track = model.points3D.at(correspondences.points[i]).track;
    const auto is_of_other = [&](const TrackElement& element) {
      return element.image_id != image_id;
    };
    if (std::count_if(track.begin(), track.end(), is_of_other) < 2) continue;
    seen.keypoints.push_back(correspondences.keypoints[i]);
    seen.points.push_back(correspondences.points[i]);
  }
  return seen;
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

// Do most of the correspondences lie off the image's pose, and agree with another one?
bool IsOutvoted(const StageContext& context, const Correspondences& correspondences,
                const Reconstruction& model, image_t image_id) {
  const RegisteredImage& image = model.images.at(image_id);
  size_t num_agreeing = 0;
  for (size_t i = 0; i < correspondences.points.size(); ++i) {
    num_agreeing += ReprojectionErrorPx(model.CameraOf(image), image.cam_from_world,
                                        model.points3D.at(correspondences.points[i]).xyz,
                                        image.points2D[correspondences.keypoints[i]]) <=
                    context.settings.resection.max_error_px;
  }
  if (2 * num_agreeing >= correspondences.points.size()) return false;
  const ResectionReport report = Resect(context, correspondences, model, image_id);
  return report.status == ResectionStatus::kSuccess && report.inliers.size() > num_agreeing;
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
  if (!registered.empty()) stage.Note("registered by resection: " + FirstNames(registered));
  if (!refused.empty()) stage.Note("not registered: " + FirstNames(refused));
  stage.Add("candidates", candidates.size());
  stage.Add("registered", registered.size());
  return static_cast<int>(registered.size());
}

std::set<image_t> FindOutvoted(StageContext& context, const BuiltModel& built) {
  ModelStage stage(context, "outvoted");
  const Reconstruction& model = *built.model;
  const ModelEvidence& evidence = built.evidence;
  const PairsOfImages pairs = FindPairsOfMembers(built.graph, model);
  std::vector<image_t> images;
  for (const auto& [id, edges] : pairs) {
    if (evidence.images.at(id).Share() < evidence.inside.Share()) images.push_back(id);
  }
  std::vector<char> is_outvoted(images.size(), 0);
  ParallelFor(context.run.num_threads, static_cast<int64_t>(images.size()), [&](int64_t i) {
    const Correspondences found =
        FindCorrespondences(context.scene, pairs.at(images[i]), model, images[i]);
    is_outvoted[i] = IsOutvoted(context, SeenByOthers(found, model, images[i]), model, images[i]);
  });
  std::set<image_t> outvoted;
  for (size_t i = 0; i < images.size(); ++i) {
    if (is_outvoted[i]) outvoted.insert(images[i]);
  }
  stage.Add("candidates", images.size());
  stage.Add("images", outvoted.size());
  return outvoted;
}

}  // namespace cairn
