#include "evaluation/model_evidence.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/geometry/epipolar.h"
#include "graph/union_find.h"

namespace cairn {
namespace {

// Tasks that a thread takes at once.
constexpr int64_t kGrain = 16;            // pairs
constexpr int64_t kGrainOfPoints = 1024;  // or of keypoints

constexpr size_t kLookahead = 16;  // matches; some ten lookups fit into one wait for memory

// A keypoint's unit bearing, and how that changes with the pixel.
struct PixelRay {
  Eigen::Vector3d ray;
  Eigen::Matrix<float, 3, 2> change_per_px;
};

// A posed image, with what its matched keypoints see: most keypoints are not matched.
struct View {
  static constexpr int kNone = -1, kWanted = -2;  // of a keypoint's ray

  const RegisteredImage* image = nullptr;
  const Camera* camera = nullptr;
  std::vector<int> index_of_ray;  // of a keypoint
  std::vector<PixelRay> rays;

  const PixelRay* RayOf(point2D_t k) const {
    return index_of_ray[k] < 0 ? nullptr : &rays[index_of_ray[k]];
  }
};
using Views = std::map<image_t, View>;

// nullopt: the camera model has none.
std::optional<PixelRay> RayOf(const Camera& camera, const Eigen::Vector2d& pixel) {
  const std::optional<Eigen::Vector3d> ray = camera.RayFromImg(pixel);
  Eigen::Matrix<double, 2, 3> J;
  if (!ray || !camera.ImgFromRay(*ray, &J)) return std::nullopt;
  const Eigen::Matrix2d square = J * J.transpose();
  if (!(square.determinant() > 0)) return std::nullopt;
  return PixelRay{*ray, (J.transpose() * square.inverse()).cast<float>()};
}

// Sampson's error in pixels: the least change of both keypoints, to first order, that puts the rays
// in one plane with the cameras (Terekhov and Larsson, "Tangent Sampson error", ICCV 2023). So it
// means the same for every lens.
double SquaredErrorPx(const Eigen::Matrix3d& E, const PixelRay& x1, const PixelRay& x2) {
  const Eigen::Vector3d normal1 = E.transpose() * x2.ray, normal2 = E * x1.ray;
  const double error = x2.ray.dot(normal2);
  return error * error /
         ((x1.change_per_px.cast<double>().transpose() * normal1).squaredNorm() +
          (x2.change_per_px.cast<double>().transpose() * normal2).squaredNorm());
}

// Of DefaultSigmaPx, what matches of photographs in focus have.
constexpr double kSharp = 0.25;

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
  double sharp_nats = 0;  // by kSharp
};

PairEvidence EvaluatePair(const View& view1, const View& view2, const FeatureMatches& matches) {
  const Rigid3d cam2_from_cam1 = view2.image->cam_from_world * Inverse(view1.image->cam_from_world);
  const double focal_px = 0.5 * (view1.camera->MeanFocal() + view2.camera->MeanFocal());
  // (More than remains in a finished model, whose own errors must not count as contradictions.)
  const double sigma_px = DefaultSigmaPx(*view1.camera, *view2.camera);
  const double width_px = 0.5 * (WidthPx(*view1.camera) + WidthPx(*view2.camera));
  const double max_nats = MaxNats(width_px, sigma_px);
  const double max_sharp_nats = MaxNats(width_px, kSharp * sigma_px);
  PairEvidence evidence;
  if (!(cam2_from_cam1.translation.norm() > 0)) return evidence;
  const Eigen::Matrix3d E = EssentialFromPose(cam2_from_cam1);
  const CheiralityTest test(cam2_from_cam1, 2 * sigma_px / focal_px);
  const CheiralityTest sharp_test(cam2_from_cam1, 2 * kSharp * sigma_px / focal_px);
  for (const FeatureMatch& match : matches) {
    const PixelRay* x1 = view1.RayOf(match.point1);
    const PixelRay* x2 = view2.RayOf(match.point2);
    if (x1 == nullptr || x2 == nullptr) continue;
    const double lost = 0.5 * SquaredErrorPx(E, *x1, *x2) / (sigma_px * sigma_px);
    if (!(lost < max_nats)) continue;
    if (!test.IsInFront(x1->ray, x2->ray)) continue;
    evidence.nats += max_nats - lost;
    const double sharp_nats = max_sharp_nats - lost / (kSharp * kSharp);
    if (sharp_nats > 0 && sharp_test.IsInFront(x1->ray, x2->ray)) evidence.sharp_nats += sharp_nats;
    evidence.explained.push_back(match);
  }
  return evidence;
}

Views MakeViews(const Reconstruction& model) {
  Views views;
  for (const auto& [id, image] : model.images) {
    View& view = views[id];
    view.image = &image;
    view.camera = &model.CameraOf(image);
    view.index_of_ray.assign(image.points2D.size(), View::kNone);
  }
  return views;
}

// Finds the rays of the keypoints of further pairs.
void FindRays(std::span<const VerifiedPair> pairs, int num_threads, Views& views) {
  const auto mark = [&](image_t image_id, const FeatureMatches& matches, auto point) {
    const auto view = views.find(image_id);
    if (view == views.end()) return;
    for (const FeatureMatch& match : matches) {
      std::atomic_ref<int> index(view->second.index_of_ray[match.*point]);
      if (index.load(std::memory_order_relaxed) == View::kNone) {
        index.store(View::kWanted, std::memory_order_relaxed);
      }
    }
  };
  ParallelFor(
      num_threads, std::ssize(pairs),
      [&](int64_t i) {
        mark(pairs[i].image_id1, *pairs[i].matches, &FeatureMatch::point1);
        mark(pairs[i].image_id2, *pairs[i].matches, &FeatureMatch::point2);
      },
      kGrain);
  std::vector<View*> order;
  for (auto& [id, view] : views) order.push_back(&view);
  ParallelFor(num_threads, std::ssize(order), [&](int64_t i) {
    View& view = *order[i];
    view.rays.reserve(view.rays.size() + std::ranges::count(view.index_of_ray, View::kWanted));
    for (size_t k = 0; k < view.index_of_ray.size(); ++k) {
      if (view.index_of_ray[k] != View::kWanted) continue;
      const std::optional<PixelRay> ray = RayOf(*view.camera, view.image->points2D[k]);
      view.index_of_ray[k] = ray ? static_cast<int>(view.rays.size()) : View::kNone;
      if (ray) view.rays.push_back(*ray);
    }
  });
}

// Calls visit(i, evidence of pair i) on the threads. Pairs with an image that the model lacks have
// nothing.
template <typename Visit>
void EvaluatePairs(const Views& views, std::span<const VerifiedPair> pairs, int num_threads,
                   const Visit& visit) {
  ParallelFor(
      num_threads, std::ssize(pairs),
      [&](int64_t i) {
        const auto view1 = views.find(pairs[i].image_id1);
        const auto view2 = views.find(pairs[i].image_id2);
        const bool is_inside = view1 != views.end() && view2 != views.end();
        visit(i, is_inside ? EvaluatePair(view1->second, view2->second, *pairs[i].matches)
                           : PairEvidence());
      },
      kGrain);
}

// Is a point as near to a keypoint, and in front, as an explained match to its epipolar line?
bool IsNear(const View& view, const Eigen::Vector3d& ray, const Eigen::Vector3d& xyz) {
  const double sigma_px = DefaultSigmaPx(*view.camera, *view.camera);
  const double max_error_px = sigma_px * std::sqrt(2 * MaxNats(WidthPx(*view.camera), sigma_px));
  const Eigen::Vector3d x = (view.image->cam_from_world * xyz).normalized();
  return x.dot(ray) > 0 && view.camera->MeanFocal() * x.cross(ray).norm() < max_error_px;
}

// Counts matches that do not follow from those before: what joins n keypoints to one track is n - 1
// of them. Threads may add at once.
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
    int num_joined = 0;
    for (size_t i = 0; i < matches.size(); ++i) {
      if (i + kLookahead < matches.size()) {
        tracks_->Prefetch(first1 + static_cast<int>(matches[i + kLookahead].point1));
        tracks_->Prefetch(first2 + static_cast<int>(matches[i + kLookahead].point2));
      }
      num_joined += tracks_->Union(first1 + static_cast<int>(matches[i].point1),
                                   first2 + static_cast<int>(matches[i].point2));
    }
    num_ += num_joined;
  }

  int64_t Num() const { return num_; }

  // Those that a model's points agree with: of a track that has points, n - 1 for n keypoints of
  // one. A keypoint that the model's filters took from its point counts where it lies near it:
  // models are compared whatever their filters were.
  int64_t NumOfPoints(const Reconstruction& model, const Views& views, int num_threads) {
    const PointsOfTracks points = SortByTracks(model, num_threads);
    int64_t num = num_ + points.num_joined;
    for (size_t node = 0; node < points.track_of.size(); ++node) {
      const int track = points.track_of[node];
      if (static_cast<int>(node) != track && !points.Of(track).empty()) --num;
    }
    return num + NumNear(points, views, num_threads);
  }

 private:
  // The points that have keypoints of a track, by its first node.
  struct PointsOfTracks {
    std::vector<int> track_of;  // node
    std::vector<size_t> begin;  // of the track's points, and one more
    std::vector<const Point3D*> points;
    int64_t num_joined = 0;  // n - 1 for n keypoints of one track in a point

    std::span<const Point3D* const> Of(int track) const {
      return std::span(points).subspan(begin[track], begin[track + 1] - begin[track]);
    }
  };

  PointsOfTracks SortByTracks(const Reconstruction& model, int num_threads) {
    PointsOfTracks sorted;
    sorted.track_of.resize(tracks_->size());
    ParallelFor(
        num_threads, tracks_->size(),
        [&](int64_t node) { sorted.track_of[node] = tracks_->Find(static_cast<int>(node)); },
        kGrainOfPoints);
    std::vector<const Point3D*> points;
    for (const auto& [id, point] : model.points3D) points.push_back(&point);
    std::vector<std::vector<int>> tracks(points.size());  // of a point, distinct
    std::atomic<int64_t> num_joined = 0;
    sorted.begin.assign(tracks_->size() + 1, 0);
    ParallelFor(
        num_threads, std::ssize(points),
        [&](int64_t i) {
          for (const TrackElement& element : points[i]->track) {
            tracks[i].push_back(sorted.track_of[NodeOf(element.image_id, element.point2D)]);
          }
          std::ranges::sort(tracks[i]);
          const auto repeated = std::unique(tracks[i].begin(), tracks[i].end());
          num_joined += tracks[i].end() - repeated;
          tracks[i].erase(repeated, tracks[i].end());
          for (const int track : tracks[i]) ++std::atomic_ref<size_t>(sorted.begin[track + 1]);
        },
        kGrainOfPoints);
    sorted.num_joined = num_joined;
    std::partial_sum(sorted.begin.begin(), sorted.begin.end(), sorted.begin.begin());
    sorted.points.resize(sorted.begin.back());
    std::vector<size_t> next = sorted.begin;
    for (size_t i = 0; i < points.size(); ++i) {
      for (const int track : tracks[i]) sorted.points[next[track]++] = points[i];
    }
    return sorted;
  }

  // Keypoints without a point that lie near one of their track.
  int64_t NumNear(const PointsOfTracks& points, const Views& views, int num_threads) const {
    std::vector<std::pair<image_t, const View*>> order;
    for (const auto& [id, view] : views) order.emplace_back(id, &view);
    std::vector<int64_t> num_of_view(order.size());
    ParallelFor(num_threads, std::ssize(order), [&](int64_t i) {
      const image_t id = order[i].first;
      const View& view = *order[i].second;
      for (point2D_t k = 0; k < view.index_of_ray.size(); ++k) {
        const PixelRay* ray = view.RayOf(k);
        if (ray == nullptr || view.image->point3D_ids[k] != kInvalidPoint3DId) continue;
        num_of_view[i] += std::ranges::any_of(
            points.Of(points.track_of[NodeOf(id, k)]),
            [&](const Point3D* point) { return IsNear(view, ray->ray, point->xyz); });
      }
    });
    return std::accumulate(num_of_view.begin(), num_of_view.end(), int64_t{0});
  }

  int NodeOf(image_t id, point2D_t point) const {
    return first_node_.at(id) + static_cast<int>(point);
  }

  std::map<image_t, int> first_node_;
  std::optional<UnionFind> tracks_;
  std::atomic<int64_t> num_ = 0;
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

Support SupportOf(const VerifiedPair& pair, const PairEvidence& found) {
  return {std::ssize(*pair.matches), std::ssize(found.explained), found.nats};
}

}  // namespace

int64_t CountIndependent(std::span<const VerifiedPair> pairs, int num_threads) {
  std::map<image_t, size_t> num_keypoints;
  for (const VerifiedPair& pair : pairs) {
    size_t &num1 = num_keypoints[pair.image_id1], &num2 = num_keypoints[pair.image_id2];
    for (const FeatureMatch& match : *pair.matches) {
      num1 = std::max<size_t>(num1, match.point1 + 1);
      num2 = std::max<size_t>(num2, match.point2 + 1);
    }
  }
  IndependentMatches independent(num_keypoints);
  ParallelFor(
      num_threads, std::ssize(pairs),
      [&](int64_t i) { independent.Add(pairs[i], *pairs[i].matches); }, kGrain);
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
  Views views = MakeViews(model);
  FindRays(pairs, run.num_threads, views);
  evidence.pairs.resize(pairs.size());
  EvaluatePairs(views, pairs, run.num_threads, [&](int64_t i, const PairEvidence& found) {
    evidence.pairs[i] = SupportOf(pairs[i], found);
    independent.Add(pairs[i], found.explained);
  });
  for (size_t i = 0; i < pairs.size(); ++i) {
    const Support& support = evidence.pairs[i];
    evidence.all = evidence.all + support;
    const auto image1 = evidence.images.find(pairs[i].image_id1);
    const auto image2 = evidence.images.find(pairs[i].image_id2);
    if (image1 == evidence.images.end() || image2 == evidence.images.end()) continue;
    ++evidence.num_pairs;
    evidence.num_contradicted += support.IsContradicted();
    for (Support* of : {&evidence.inside, &image1->second, &image2->second}) *of = *of + support;
  }
  evidence.num_independent = independent.NumOfPoints(model, views, run.num_threads);
  if (evidence.all.num_explained > 0) {
    evidence.nats = evidence.all.nats * evidence.num_independent / evidence.all.num_explained;
  }
  evidence.nats -= ParameterCost(model, evidence.images, constant_cameras);
  return evidence;
}

Agreement EvaluateAgreement(const Reconstruction& model, std::span<const VerifiedPair> pairs,
                            const RunContext& run) {
  Views views = MakeViews(model);
  FindRays(pairs, run.num_threads, views);
  struct Nats {
    double sharp = 0, whole = 0;
  };
  std::vector<Nats> nats(pairs.size());
  EvaluatePairs(views, pairs, run.num_threads, [&](int64_t i, const PairEvidence& found) {
    nats[i] = {found.sharp_nats, found.nats};
  });
  Agreement agreement;
  std::map<image_t, double>& images = agreement.sharp_nats_of_images;
  for (const auto& [id, image] : model.images) images[id] = 0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto image1 = images.find(pairs[i].image_id1);
    const auto image2 = images.find(pairs[i].image_id2);
    if (image1 == images.end() || image2 == images.end()) continue;
    agreement.whole_nats += nats[i].whole;
    for (double* of : {&agreement.sharp_nats, &image1->second, &image2->second}) {
      *of += nats[i].sharp;
    }
  }
  return agreement;
}

double StandardErrorsOfGain(const Agreement& model1, const Agreement& model2) {
  const double gain = model2.sharp_nats - model1.sharp_nats;
  if (gain > 0 && !(model2.whole_nats > model1.whole_nats)) return 0;
  const auto num_images = static_cast<double>(model2.sharp_nats_of_images.size());
  std::vector<double> without;  // each image
  double mean = 0;
  for (const auto& [id, nats] : model2.sharp_nats_of_images) {
    without.push_back(gain - (nats - model1.sharp_nats_of_images.at(id)));
    mean += without.back() / num_images;
  }
  double sum = 0;
  for (const double each : without) sum += (each - mean) * (each - mean);
  const double error = std::sqrt(sum * (num_images - 1) / num_images);
  return error > 0 ? gain / error : 0;
}

double NormalDeviate(double t, double degrees) {
  const double deviate =
      (8 * degrees + 1) / (8 * degrees + 3) * std::sqrt(degrees * std::log1p(t * t / degrees));
  return std::copysign(deviate, t);
}

std::vector<Support> EvaluateSupports(const Reconstruction& model, const PairReader& read,
                                      const RunContext& run) {
  Views views = MakeViews(model);
  std::vector<Support> supports;
  for (std::span<const VerifiedPair> pairs = read(); !pairs.empty(); pairs = read()) {
    FindRays(pairs, run.num_threads, views);
    const size_t first = supports.size();
    supports.resize(first + pairs.size());
    EvaluatePairs(views, pairs, run.num_threads, [&](int64_t i, const PairEvidence& found) {
      supports[first + i] = SupportOf(pairs[i], found);
    });
  }
  return supports;
}

std::vector<FeatureMatches> ExplainedMatches(const Reconstruction& model,
                                             std::span<const VerifiedPair> pairs,
                                             const RunContext& run) {
  Views views = MakeViews(model);
  FindRays(pairs, run.num_threads, views);
  std::vector<FeatureMatches> explained(pairs.size());
  EvaluatePairs(views, pairs, run.num_threads,
                [&](int64_t i, PairEvidence found) { explained[i] = std::move(found.explained); });
  return explained;
}

}  // namespace cairn
