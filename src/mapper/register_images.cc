#include <algorithm>
#include <functional>

#include "base/text.h"
#include "cairn/base/parallel.h"
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
    const bool has_first = model.images.contains(edge.image_id1);
    if (has_first == model.images.contains(edge.image_id2)) continue;
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

// The camera, where the model has it already, or a larger one found it; else nullptr.
const Camera* FindKnown(const StageContext& context, const Reconstruction& model, camera_t id) {
  for (const std::map<camera_t, Camera>* cameras : {&model.cameras, &context.found_cameras}) {
    if (const auto known = cameras->find(id); known != cameras->end()) return &known->second;
  }
  return nullptr;
}

ResectionReport Resect(const StageContext& context, const Correspondences& correspondences,
                       const Reconstruction& model, image_t image_id) {
  const Image& image = context.scene.images.at(image_id);
  const Camera* const known = FindKnown(context, model, image.camera_id);
  const Camera& camera = known != nullptr ? *known : context.scene.cameras.at(image.camera_id);
  const bool is_guess = known == nullptr && !camera.has_prior_focal_length &&
                        !camera.FocalIndices().empty() &&
                        !context.scene.constant_cameras.contains(image.camera_id);
  std::vector<Eigen::Vector2d> pixels;
  std::vector<Eigen::Vector3d> xyz;
  for (size_t i = 0; i < correspondences.points.size(); ++i) {
    pixels.push_back(context.scene.pixels.at(image_id)[correspondences.keypoints[i]]);
    xyz.push_back(model.points3D.at(correspondences.points[i]).xyz);
  }
  return EstimateAbsolutePose(camera, {pixels, xyz}, is_guess, context.settings.resection,
                              Rng(context.run.seed, "resection", image_id));
}

struct Candidate {
  image_t image_id;
  Correspondences correspondences;
  bool is_done = false;
  ResectionReport report = {};
};

// The images outside that see enough points of the model, those with the most first: they are the
// surest.
std::vector<Candidate> FindCandidates(const StageContext& context, const ViewGraph& graph,
                                      const Reconstruction& model) {
  std::vector<Candidate> found;
  const auto pairs = FindPairsOfOutsiders(graph, model);
  for (const auto& [id, edges] : pairs) {
    if (!context.taken.contains(id) && !context.reserved.contains(id)) found.push_back({id, {}});
  }
  ParallelFor(context.run.num_threads, std::ssize(found), [&](int64_t i) {
    const image_t id = found[i].image_id;
    found[i].correspondences = FindCorrespondences(context.scene, pairs.at(id), model, id);
  });
  std::erase_if(found, [&](const Candidate& candidate) {
    return std::ssize(candidate.correspondences.points) <
           context.settings.resection.min_num_inliers;
  });
  std::ranges::stable_sort(found, std::greater<>(), [](const Candidate& candidate) {
    return candidate.correspondences.points.size();
  });
  return found;
}

// The next candidates whose poses do not depend on each other: of those with a camera that the
// model lacks, the first, which makes it known.
std::vector<Candidate*> NextOnes(const StageContext& context, const Reconstruction& model,
                                 std::vector<Candidate>& candidates) {
  std::vector<Candidate*> next;
  std::set<camera_t> unknown;
  for (Candidate& candidate : candidates) {
    const camera_t camera_id = context.scene.images.at(candidate.image_id).camera_id;
    if (candidate.is_done) continue;
    if (model.cameras.contains(camera_id) || unknown.insert(camera_id).second) {
      next.push_back(&candidate);
    }
  }
  return next;
}

}  // namespace

int RegisterLeftOut(StageContext& context, const ViewGraph& graph, Reconstruction& model) {
  ModelStage stage(context, "registration");
  std::vector<Candidate> candidates = FindCandidates(context, graph, model);
  for (;;) {
    const std::vector<Candidate*> next = NextOnes(context, model, candidates);
    if (next.empty()) break;
    ParallelFor(context.run.num_threads, std::ssize(next), [&](int64_t i) {
      next[i]->report = Resect(context, next[i]->correspondences, model, next[i]->image_id);
      next[i]->is_done = true;
    });
    for (const Candidate* candidate : next) {
      const ResectionReport& report = candidate->report;
      if (report.status != ResectionStatus::kSuccess) continue;
      AddImage(context.scene, candidate->image_id, report.cam_from_world, report.camera, model);
    }
  }
  std::vector<std::string> registered, refused;
  for (const Candidate& candidate : candidates) {
    const bool is_registered = candidate.report.status == ResectionStatus::kSuccess;
    (is_registered ? registered : refused)
        .push_back(context.scene.images.at(candidate.image_id).name + " (" +
                   std::to_string(candidate.report.inliers.size()) + " of " +
                   std::to_string(candidate.correspondences.points.size()) + " points agree)");
  }
  if (!registered.empty()) stage.Record("registered by resection: " + FirstNames(registered));
  if (!refused.empty()) stage.Record("not registered: " + FirstNames(refused));
  stage.Add("candidates", candidates.size());
  stage.Add("registered", registered.size());
  return static_cast<int>(registered.size());
}

}  // namespace cairn
