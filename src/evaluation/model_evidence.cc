#include "cairn/evaluation/model_evidence.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "cairn/base/parallel.h"
#include "cairn/geometry/epipolar.h"

namespace cairn {
namespace {

// A posed image, with the unit bearings of its keypoints.
struct View {
  const RegisteredImage* image = nullptr;
  const Camera* camera = nullptr;
  std::vector<std::optional<Eigen::Vector3d>> rays;
};

// Mean width of an image across its epipolar lines, pixels.
double WidthPx(const Camera& camera) {
  return static_cast<double>(camera.width) * camera.height / camera.DiagonalPx();
}

struct PairEvidence {
  int64_t num_explained = 0;
  FeatureMatches explained;  // where they are asked for
  double nats = 0;
};

PairEvidence EvaluatePair(const View& view1, const View& view2, const FeatureMatches& matches,
                          bool keep_matches) {
  const Rigid3d cam2_from_cam1 = view2.image->cam_from_world * Inverse(view1.image->cam_from_world);
  const double focal_px = 0.5 * (view1.camera->MeanFocal() + view2.camera->MeanFocal());
  // Two-view verification's threshold is taken as the standard deviation: what remains of it in a
  // finished model is less, and errors of the model itself must not count as contradictions.
  const double sigma_px = DefaultMaxErrorPx(*view1.camera, *view2.camera);
  const double gain = std::log(0.5 * (WidthPx(*view1.camera) + WidthPx(*view2.camera)) /
                               (sigma_px * std::sqrt(2 * std::numbers::pi)));
  PairEvidence evidence;
  if (!(cam2_from_cam1.translation.norm() > 0)) return evidence;
  const Eigen::Matrix3d E = EssentialFromPose(cam2_from_cam1);
  const bool is_planar = view1.camera->IsPlanar() && view2.camera->IsPlanar();
  for (const FeatureMatch& match : matches) {
    const auto& x1 = view1.rays[match.point1];
    const auto& x2 = view2.rays[match.point2];
    if (!x1 || !x2) continue;
    const double squared_error =
        focal_px * focal_px *
        (is_planar ? SquaredSampsonError(E, x1->hnormalized(), x2->hnormalized())
                   : SquaredRaySampsonError(E, *x1, *x2));
    const double nats = gain - 0.5 * squared_error / (sigma_px * sigma_px);
    if (!(nats > 0)) continue;
    // The depths of rays that are parallel within their noise may have either sign.
    const Eigen::Vector3d turned = cam2_from_cam1.rotation * *x1;
    const double parallax = turned.cross(*x2).norm();
    double depth1 = 0, depth2 = 0;
    if (parallax * focal_px > 2 * sigma_px &&
        !(TriangulateRayDepths(cam2_from_cam1, *x1, *x2, &depth1, &depth2) && depth1 > 0 &&
          depth2 > 0)) {
      continue;
    }
    evidence.nats += nats;
    ++evidence.num_explained;
    if (keep_matches) evidence.explained.push_back(match);
  }
  return evidence;
}

// The views of the model; rays only of keypoints that are matched.
std::map<image_t, View> MakeViews(const Reconstruction& model, std::span<const VerifiedPair> pairs,
                                  int num_threads) {
  std::map<image_t, View> views;
  std::vector<View*> order;
  for (const auto& [id, image] : model.images) {
    View& view = views[id];
    view.image = &image;
    view.camera = &model.CameraOf(image);
    view.rays.resize(image.points2D.size());
    order.push_back(&view);
  }
  std::map<image_t, std::vector<char>> is_matched;
  for (const auto& [id, view] : views) is_matched[id].assign(view.rays.size(), 0);
  for (const VerifiedPair& pair : pairs) {
    const auto matched1 = is_matched.find(pair.image_id1);
    const auto matched2 = is_matched.find(pair.image_id2);
    for (const FeatureMatch& match : *pair.matches) {
      if (matched1 != is_matched.end()) matched1->second[match.point1] = 1;
      if (matched2 != is_matched.end()) matched2->second[match.point2] = 1;
    }
  }
  ParallelFor(num_threads, static_cast<int64_t>(order.size()), [&](int64_t i) {
    View& view = *order[i];
    const std::vector<char>& matched = is_matched.at(view.image->image.image_id);
    for (size_t k = 0; k < view.rays.size(); ++k) {
      if (matched[k]) view.rays[k] = view.camera->RayFromImg(view.image->points2D[k]);
    }
  });
  return views;
}

// Pairs with an image that the model lacks have nothing.
std::vector<PairEvidence> EvaluatePairs(const Reconstruction& model,
                                        std::span<const VerifiedPair> pairs, int num_threads,
                                        bool keep_matches) {
  const std::map<image_t, View> views = MakeViews(model, pairs, num_threads);
  std::vector<PairEvidence> of_pair(pairs.size());
  ParallelFor(
      num_threads, static_cast<int64_t>(pairs.size()),
      [&](int64_t i) {
        const auto view1 = views.find(pairs[i].image_id1);
        const auto view2 = views.find(pairs[i].image_id2);
        if (view1 == views.end() || view2 == views.end()) return;
        of_pair[i] = EvaluatePair(view1->second, view2->second, *pairs[i].matches, keep_matches);
      },
      16);
  return of_pair;
}

}  // namespace

ModelEvidence EvaluateEvidence(const Reconstruction& model, std::span<const VerifiedPair> pairs,
                               const RunContext& run) {
  const std::vector<PairEvidence> of_pair = EvaluatePairs(model, pairs, run.num_threads, false);
  ModelEvidence evidence;
  for (const auto& [id, image] : model.images) evidence.images[id] = {};
  for (size_t i = 0; i < pairs.size(); ++i) {
    const Support support = {static_cast<int64_t>(pairs[i].matches->size()),
                             of_pair[i].num_explained};
    evidence.pairs.push_back(support);
    evidence.all.num_matches += support.num_matches;
    evidence.all.num_explained += support.num_explained;
    evidence.nats += of_pair[i].nats;
    const auto image1 = evidence.images.find(pairs[i].image_id1);
    const auto image2 = evidence.images.find(pairs[i].image_id2);
    if (image1 == evidence.images.end() || image2 == evidence.images.end()) continue;
    ++evidence.num_pairs;
    evidence.inside.num_matches += support.num_matches;
    evidence.inside.num_explained += support.num_explained;
    evidence.num_contradicted += support.IsContradicted();
    for (Support* of_image : {&image1->second, &image2->second}) {
      of_image->num_matches += support.num_matches;
      of_image->num_explained += support.num_explained;
    }
  }
  constexpr double kPoseParameters = 6;
  for (const auto& [id, support] : evidence.images) {
    evidence.nats -= 0.5 * kPoseParameters * std::log(std::max<double>(1, support.num_matches));
  }
  return evidence;
}

std::vector<FeatureMatches> ExplainedMatches(const Reconstruction& model,
                                             std::span<const VerifiedPair> pairs,
                                             const RunContext& run) {
  std::vector<FeatureMatches> explained;
  for (PairEvidence& pair : EvaluatePairs(model, pairs, run.num_threads, true)) {
    explained.push_back(std::move(pair.explained));
  }
  return explained;
}

}  // namespace cairn
