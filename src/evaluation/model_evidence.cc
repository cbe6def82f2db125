#include "evaluation/model_evidence.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/geometry/epipolar.h"
#include "graph/union_find.h"

namespace cairn {
namespace {

// A posed image, with the unit bearings of its matched keypoints.
struct View {
  const RegisteredImage* image = nullptr;
  const Camera* camera = nullptr;
  std::vector<char> is_matched;
  std::vector<std::optional<Eigen::Vector3d>> rays;
};

// Mean width of an image across its epipolar lines, pixels.
double WidthPx(const Camera& camera) {
  return static_cast<double>(camera.width) * camera.height / camera.DiagonalPx();
}

// What a match saves that lies on its epipolar line (ModelEvidence).
double MaxNats(double width_px, double sigma_px) {
  return std::log(width_px / (sigma_px * std::sqrt(2 * std::numbers::pi)));
}

struct PairEvidence {
  FeatureMatches explained;
  double nats = 0;
};

PairEvidence EvaluatePair(const View& view1, const View& view2, const FeatureMatches& matches) {
  const Rigid3d cam2_from_cam1 = view2.image->cam_from_world * Inverse(view1.image->cam_from_world);
  const double focal_px = 0.5 * (view1.camera->MeanFocal() + view2.camera->MeanFocal());
  // Two-view verification's threshold is taken as the standard deviation: what remains of it in a
  // finished model is less, and errors of the model itself must not count as contradictions.
  const double sigma_px = DefaultMaxErrorPx(*view1.camera, *view2.camera);
  const double max_nats =
      MaxNats(0.5 * (WidthPx(*view1.camera) + WidthPx(*view2.camera)), sigma_px);
  PairEvidence evidence;
  if (!(cam2_from_cam1.translation.norm() > 0)) return evidence;
  const Eigen::Matrix3d E = EssentialFromPose(cam2_from_cam1);
  const CheiralityTest test(cam2_from_cam1, 2 * sigma_px / focal_px);
  const bool is_planar = view1.camera->IsPlanar() && view2.camera->IsPlanar();
  for (const FeatureMatch& match : matches) {
    const auto& x1 = view1.rays[match.point1];
    const auto& x2 = view2.rays[match.point2];
    if (!x1 || !x2) continue;
    const double squared_error =
        focal_px * focal_px *
        (is_planar ? SquaredSampsonError(E, x1->hnormalized(), x2->hnormalized())
                   : SquaredRaySampsonError(E, *x1, *x2));
    const double nats = max_nats - 0.5 * squared_error / (sigma_px * sigma_px);
    if (!(nats > 0)) continue;
    if (!test.IsInFront(*x1, *x2)) continue;
    evidence.nats += nats;
    evidence.explained.push_back(match);
  }
  return evidence;
}

std::map<image_t, View> MakeViews(const Reconstruction& model, std::span<const VerifiedPair> pairs,
                                  int num_threads) {
  std::map<image_t, View> views;
  std::vector<View*> order;
  for (const auto& [id, image] : model.images) {
    View& view = views[id];
    view.image = &image;
    view.camera = &model.CameraOf(image);
    view.is_matched.resize(image.points2D.size());
    view.rays.resize(image.points2D.size());
    order.push_back(&view);
  }
  for (const VerifiedPair& pair : pairs) {
    const auto view1 = views.find(pair.image_id1), view2 = views.find(pair.image_id2);
    for (const FeatureMatch& match : *pair.matches) {
      if (view1 != views.end()) view1->second.is_matched[match.point1] = 1;
      if (view2 != views.end()) view2->second.is_matched[match.point2] = 1;
    }
  }
  ParallelFor(num_threads, static_cast<int64_t>(order.size()), [&](int64_t i) {
    View& view = *order[i];
    for (size_t k = 0; k < view.rays.size(); ++k) {
      if (view.is_matched[k]) view.rays[k] = view.camera->RayFromImg(view.image->points2D[k]);
    }
  });
  return views;
}

// The explained matches of so many pairs are held at a time.
constexpr int64_t kPairsAtATime = 4096;

// Visits the pairs in their order. Those with an image that the model lacks have nothing.
template <typename Visit>
void EvaluatePairs(const std::map<image_t, View>& views, std::span<const VerifiedPair> pairs,
                   int num_threads, const Visit& visit) {
  const auto num_pairs = static_cast<int64_t>(pairs.size());
  std::vector<PairEvidence> of_pair;
  for (int64_t begin = 0; begin < num_pairs; begin += kPairsAtATime) {
    of_pair.assign(std::min(kPairsAtATime, num_pairs - begin), {});
    ParallelFor(
        num_threads, std::ssize(of_pair),
        [&](int64_t i) {
          const VerifiedPair& pair = pairs[begin + i];
          const auto view1 = views.find(pair.image_id1);
          const auto view2 = views.find(pair.image_id2);
          if (view1 == views.end() || view2 == views.end()) return;
          of_pair[i] = EvaluatePair(view1->second, view2->second, *pair.matches);
        },
        16);
    for (size_t i = 0; i < of_pair.size(); ++i) visit(pairs[begin + i], std::move(of_pair[i]));
  }
}

// Is a point as near to a keypoint, and in front, as an explained match to its epipolar line?
bool IsNear(const View& view, const Eigen::Vector3d& ray, const Eigen::Vector3d& xyz) {
  const double sigma_px = DefaultMaxErrorPx(*view.camera, *view.camera);
  const double max_error_px = sigma_px * std::sqrt(2 * MaxNats(WidthPx(*view.camera), sigma_px));
  const Eigen::Vector3d x = (view.image->cam_from_world * xyz).normalized();
  return x.dot(ray) > 0 && view.camera->MeanFocal() * x.cross(ray).norm() < max_error_px;
}

// Counts matches that do not follow from those before: what joins n keypoints to one track is n - 1
// of them.
class IndependentMatches {
 public:
  explicit IndependentMatches(const std::map<image_t, size_t>& num_keypoints) {
    size_t total = 0;
    for (const auto& [id, num] : num_keypoints) {
      first_node_[id] = static_cast<int>(total);
      total += num;
    }
    CAIRN_CHECK_LE(total, static_cast<size_t>(std::numeric_limits<int>::max()));
    tracks_.emplace(static_cast<int>(total));
  }

  void Add(const VerifiedPair& pair, const FeatureMatches& matches) {
    if (matches.empty()) return;
    const int first1 = first_node_.at(pair.image_id1);
    const int first2 = first_node_.at(pair.image_id2);
    for (const FeatureMatch& match : matches) {
      num_ += tracks_->Union(first1 + static_cast<int>(match.point1),
                             first2 + static_cast<int>(match.point2));
    }
  }

  int64_t Num() const { return num_; }

  // Those that a model's points agree with: of a track that has points, n - 1 for n keypoints of
  // one. A keypoint that the model's filters took from its point counts where it lies near it:
  // models are compared whatever their filters were.
  int64_t NumOfPoints(const Reconstruction& model, const std::map<image_t, View>& views) {
    int64_t num = num_;
    PointsOfTracks points;
    std::vector<int> tracks;  // of a point's keypoints
    for (const auto& [id, point] : model.points3D) {
      tracks.clear();
      for (const TrackElement& element : point.track) tracks.push_back(TrackOf(element));
      std::sort(tracks.begin(), tracks.end());
      for (size_t i = 0; i < tracks.size(); ++i) {
        if (i > 0 && tracks[i] == tracks[i - 1]) {
          ++num;
        } else {
          points.emplace_back(tracks[i], &point);
        }
      }
    }
    std::stable_sort(points.begin(), points.end(), IsOfEarlierTrack);
    for (size_t i = 0; i < points.size(); ++i) {
      const int track = points[i].first;
      if (i == 0 || track != points[i - 1].first) num -= tracks_->SizeOf(track) - 1;
    }
    return num + NumNear(points, views);
  }

 private:
  // Points by their tracks, as the nodes that represent these.
  using PointsOfTracks = std::vector<std::pair<int, const Point3D*>>;
  static bool IsOfEarlierTrack(const PointsOfTracks::value_type& a,
                               const PointsOfTracks::value_type& b) {
    return a.first < b.first;
  }

  int TrackOf(const TrackElement& element) {
    return tracks_->Find(first_node_.at(element.image_id) + static_cast<int>(element.point2D));
  }

  // Keypoints without a point that lie near one of their track.
  int64_t NumNear(const PointsOfTracks& points, const std::map<image_t, View>& views) {
    int64_t num = 0;
    for (const auto& [id, view] : views) {
      for (point2D_t k = 0; k < view.rays.size(); ++k) {
        if (!view.rays[k] || view.image->point3D_ids[k] != kInvalidPoint3DId) continue;
        const auto [first, last] = std::equal_range(
            points.begin(), points.end(), PointsOfTracks::value_type(TrackOf({id, k}), nullptr),
            IsOfEarlierTrack);
        num += std::any_of(first, last, [&](const auto& of_track) {
          return IsNear(view, *view.rays[k], of_track.second->xyz);
        });
      }
    }
    return num;
  }

  std::map<image_t, int> first_node_;
  std::optional<UnionFind> tracks_;
  int64_t num_ = 0;
};

// Of poses, and of focal lengths and distortions that are not constant.
double ParameterCost(const Reconstruction& model, const std::map<image_t, Support>& images,
                     const std::set<camera_t>& constant_cameras) {
  constexpr int kPoseParameters = 6;
  std::map<camera_t, int64_t> num_matches;
  double nats = 0;
  const auto add = [&nats](size_t num_parameters, int64_t num) {
    nats += 0.5 * num_parameters * std::log(std::max<double>(1, num));
  };
  for (const auto& [id, support] : images) {
    add(kPoseParameters, support.num_matches);
    num_matches[model.images.at(id).image.camera_id] += support.num_matches;
  }
  for (const auto& [id, num] : num_matches) {
    if (constant_cameras.count(id) > 0) continue;
    const Camera& camera = model.cameras.at(id);
    add(camera.FocalIndices().size() + camera.DistortionIndices().size(), num);
  }
  return nats;
}

}  // namespace

int64_t CountIndependent(std::span<const VerifiedPair> pairs) {
  std::map<image_t, size_t> num_keypoints;
  const auto include = [&](image_t id, point2D_t point) {
    size_t& num = num_keypoints[id];
    num = std::max<size_t>(num, point + 1);
  };
  for (const VerifiedPair& pair : pairs) {
    for (const FeatureMatch& match : *pair.matches) {
      include(pair.image_id1, match.point1);
      include(pair.image_id2, match.point2);
    }
  }
  IndependentMatches independent(num_keypoints);
  for (const VerifiedPair& pair : pairs) independent.Add(pair, *pair.matches);
  return independent.Num();
}

ModelEvidence EvaluateEvidence(const Reconstruction& model, std::span<const VerifiedPair> pairs,
                               const RunContext& run, const std::set<camera_t>& constant_cameras) {
  ModelEvidence evidence;
  std::map<image_t, size_t> num_keypoints;
  for (const auto& [id, image] : model.images) {
    evidence.images[id] = {};
    num_keypoints[id] = image.points2D.size();
  }
  IndependentMatches independent(num_keypoints);
  const std::map<image_t, View> views = MakeViews(model, pairs, run.num_threads);
  EvaluatePairs(views, pairs, run.num_threads, [&](const VerifiedPair& pair, PairEvidence found) {
    const Support support = {std::ssize(*pair.matches), std::ssize(found.explained), found.nats};
    evidence.pairs.push_back(support);
    evidence.all = evidence.all + support;
    independent.Add(pair, found.explained);
    const auto image1 = evidence.images.find(pair.image_id1);
    const auto image2 = evidence.images.find(pair.image_id2);
    if (image1 == evidence.images.end() || image2 == evidence.images.end()) return;
    ++evidence.num_pairs;
    evidence.num_contradicted += support.IsContradicted();
    for (Support* of : {&evidence.inside, &image1->second, &image2->second}) *of = *of + support;
  });
  evidence.num_independent = independent.NumOfPoints(model, views);
  if (evidence.all.num_explained > 0) {
    evidence.nats = evidence.all.nats * evidence.num_independent / evidence.all.num_explained;
  }
  evidence.nats -= ParameterCost(model, evidence.images, constant_cameras);
  return evidence;
}

double StandardErrorsOfGain(const ModelEvidence& model1, const ModelEvidence& model2) {
  const double num_images = static_cast<double>(model2.images.size());
  const double gain = model2.inside.nats - model1.inside.nats;
  std::vector<double> without;  // each image
  double mean = 0;
  for (const auto& [id, support] : model2.images) {
    without.push_back(gain - (support.nats - model1.images.at(id).nats));
    mean += without.back() / num_images;
  }
  double sum = 0;
  for (const double each : without) sum += (each - mean) * (each - mean);
  const double error = std::sqrt(sum * (num_images - 1) / num_images);
  return error > 0 ? gain / error : 0;
}

std::vector<FeatureMatches> ExplainedMatches(const Reconstruction& model,
                                             std::span<const VerifiedPair> pairs,
                                             const RunContext& run) {
  std::vector<FeatureMatches> explained;
  EvaluatePairs(MakeViews(model, pairs, run.num_threads), pairs, run.num_threads,
                [&](const VerifiedPair&, PairEvidence found) {
                  explained.push_back(std::move(found.explained));
                });
  return explained;
}

}  // namespace cairn
