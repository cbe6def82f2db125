#include <algorithm>
#include <array>
#include <functional>
#include <utility>

#include "cairn/base/parallel.h"
#include "cairn/base/rng.h"
#include "cairn/evaluation/alignment.h"
#include "cairn/math/median.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// A point of one model where a match has it in an image of the other.
struct Sighting {
  Eigen::Vector3d xyz;
  const RegisteredImage* image;
  point2D_t keypoint;
};

// A verified pair of an image of each.
struct CrossingPair {
  const RegisteredImage* in_rest;
  const RegisteredImage* in_part;
  Rigid3d part_from_rest;  // camera frames, |translation| = 1
};

// What the matches between the images of two models say.
struct Crossing {
  std::vector<CrossingPair> pairs;                        // with a direction
  std::vector<Sighting> in_rest;                          // points of the part
  std::vector<Sighting> in_part;                          // points of the rest
  std::vector<Eigen::Vector3d> rest_points, part_points;  // that a match says are one
};

// Matched keypoints, each match and each sighting once.
class CrossingFinder {
 public:
  CrossingFinder(const Reconstruction& rest, const Reconstruction& part)
      : rest_(rest), part_(part) {}

  void Add(const TrackElement& in_rest, const TrackElement& in_part) {
    const point3D_t of_rest = PointAt(rest_, in_rest), of_part = PointAt(part_, in_part);
    if (of_part != kInvalidPoint3DId) in_rest_.insert({in_rest, of_part});
    if (of_rest != kInvalidPoint3DId) in_part_.insert({in_part, of_rest});
    if (of_part != kInvalidPoint3DId && of_rest != kInvalidPoint3DId) {
      both_.insert({of_rest, of_part});
    }
  }

  Crossing Find() const {
    Crossing crossing;
    crossing.in_rest = SightingsOf(in_rest_, rest_, part_);
    crossing.in_part = SightingsOf(in_part_, part_, rest_);
    for (const auto& [of_rest, of_part] : both_) {
      crossing.rest_points.push_back(rest_.points3D.at(of_rest).xyz);
      crossing.part_points.push_back(part_.points3D.at(of_part).xyz);
    }
    return crossing;
  }

 private:
  using Seen = std::set<std::pair<TrackElement, point3D_t>>;

  static point3D_t PointAt(const Reconstruction& model, const TrackElement& element) {
    return model.images.at(element.image_id).point3D_ids[element.point2D];
  }
  static std::vector<Sighting> SightingsOf(const Seen& seen, const Reconstruction& images,
                                           const Reconstruction& points) {
    std::vector<Sighting> sightings;
    for (const auto& [element, point] : seen) {
      sightings.push_back(
          {points.points3D.at(point).xyz, &images.images.at(element.image_id), element.point2D});
    }
    return sightings;
  }

  const Reconstruction& rest_;
  const Reconstruction& part_;
  Seen in_rest_, in_part_;
  std::set<std::pair<point3D_t, point3D_t>> both_;
};

Crossing FindCrossing(const StageContext& context, const ViewGraph& graph,
                      const Reconstruction& rest, const Reconstruction& part) {
  CrossingFinder finder(rest, part);
  std::vector<CrossingPair> pairs;
  for (const ViewEdge& edge : graph.edges) {
    if (edge.removal == EdgeRemoval::kAmbiguous) continue;  // leads to another place
    const bool is_rest_first = rest.images.contains(edge.image_id1);
    const image_t in_rest = is_rest_first ? edge.image_id1 : edge.image_id2;
    const image_t in_part = is_rest_first ? edge.image_id2 : edge.image_id1;
    if (!rest.images.contains(in_rest) || !part.images.contains(in_part)) continue;
    for (const FeatureMatch& match : context.scene.matches.at(edge.PairId())) {
      finder.Add({in_rest, is_rest_first ? match.point1 : match.point2},
                 {in_part, is_rest_first ? match.point2 : match.point1});
    }
    if (!edge.HasTranslation()) continue;
    pairs.push_back({&rest.images.at(in_rest), &part.images.at(in_part),
                     is_rest_first ? edge.cam2_from_cam1 : Inverse(edge.cam2_from_cam1)});
  }
  Crossing crossing = finder.Find();
  crossing.pairs = std::move(pairs);
  return crossing;
}

// The length of the baseline a_from_b.translation in the unit of the world of camera b, whose
// points camera a's image shows: ray x (R point + length t) = 0, the median over these; 0 without
// any.
double BaselineLength(const Rigid3d& a_from_b, const std::vector<Sighting>& sightings,
                      const RegisteredImage& a, const Camera& camera_of_a,
                      const RegisteredImage& b) {
  std::vector<double> lengths;
  for (const Sighting& sighting : sightings) {
    if (sighting.image != &a) continue;
    const auto ray = camera_of_a.RayFromImg(a.points2D[sighting.keypoint]);
    if (!ray) continue;
    const Eigen::Vector3d along = ray->cross(a_from_b.translation);
    const Eigen::Vector3d turned =
        ray->cross(a_from_b.rotation * (b.cam_from_world * sighting.xyz));
    lengths.push_back(-along.dot(turned) / along.squaredNorm());
  }
  return lengths.empty() ? 0 : UpperMedian(lengths);
}

// Whether a sighting agrees with a similarity that takes its point to its image's world.
bool Agrees(const Sighting& sighting, const Sim3d& image_from_point, const Reconstruction& model,
            double max_error_px) {
  const RegisteredImage& image = *sighting.image;
  const Camera& camera = model.CameraOf(image);
  return ReprojectionErrorPx(camera, image.cam_from_world, image_from_point * sighting.xyz,
                             image.points2D[sighting.keypoint]) <=
         max_error_px * camera.ErrorScale();
}

// Searches the similarity with which most sightings agree.
class PlaceSearch {
 public:
  PlaceSearch(const StageContext& context, const Reconstruction& rest, const Reconstruction& part,
              const Crossing& crossing)
      : context_(context), rest_(rest), part_(part), crossing_(crossing) {}

  size_t NumSightings() const { return crossing_.in_rest.size() + crossing_.in_part.size(); }

  // Of every so many sightings.
  int NumAgreeing(const Sim3d& rest_from_part, size_t stride = 1) const {
    const double max_error_px = context_.settings.resection.max_error_px;
    const Sim3d part_from_rest = Inverse(rest_from_part);
    int num_agreeing = 0;
    for (size_t i = 0; i < crossing_.in_rest.size(); i += stride) {
      num_agreeing += Agrees(crossing_.in_rest[i], rest_from_part, rest_, max_error_px);
    }
    for (size_t i = 0; i < crossing_.in_part.size(); i += stride) {
      num_agreeing += Agrees(crossing_.in_part[i], part_from_rest, part_, max_error_px);
    }
    return num_agreeing;
  }

  // The best of what triples of points and single pairs say: of those that are best by some
  // sightings, by all of them.
  PlaceOfPart Find() const {
    const int64_t num_triples = crossing_.rest_points.size() < 3 ? 0 : kNumTriples;
    const size_t stride = std::max<size_t>(1, NumSightings() / kRoughSightings);
    std::vector<PlaceOfPart> places(num_triples + crossing_.pairs.size());
    ParallelFor(context_.run.num_threads, std::ssize(places), [&](int64_t i) {
      const std::optional<Sim3d> place =
          i < num_triples ? ByTriple(i) : ByPair(crossing_.pairs[i - num_triples]);
      if (!place) return;
      places[i] = {.rest_from_part = *place, .num_agreeing = NumAgreeing(*place, stride)};
    });
    std::erase_if(places, [](const PlaceOfPart& place) { return place.num_agreeing == 0; });
    std::ranges::stable_sort(places, std::greater<>(), &PlaceOfPart::num_agreeing);
    places.resize(std::min(places.size(), kNumCounted));
    ParallelFor(context_.run.num_threads, std::ssize(places),
                [&](int64_t i) { places[i].num_agreeing = NumAgreeing(places[i].rest_from_part); });
    if (places.empty()) return {};
    return *std::ranges::max_element(places, {}, &PlaceOfPart::num_agreeing);
  }

 private:
  static constexpr int kNumTriples = 3000;
  static constexpr size_t kRoughSightings = 1000;
  static constexpr size_t kNumCounted = 100;

  // A pair's relative pose leaves the scale open, which points of each model in the other's image
  // tell.
  std::optional<Sim3d> ByPair(const CrossingPair& pair) const {
    const double length_in_rest =
        BaselineLength(pair.part_from_rest, crossing_.in_part, *pair.in_part,
                       part_.CameraOf(*pair.in_part), *pair.in_rest);
    const double length_in_part =
        BaselineLength(Inverse(pair.part_from_rest), crossing_.in_rest, *pair.in_rest,
                       rest_.CameraOf(*pair.in_rest), *pair.in_part);
    if (!(length_in_rest > 0 && length_in_part > 0)) return std::nullopt;
    const double scale = length_in_rest / length_in_part;
    const Rigid3d cam_from_rest =
        Rigid3d(pair.part_from_rest.rotation, length_in_rest * pair.part_from_rest.translation) *
        pair.in_rest->cam_from_world;
    const Rigid3d& cam_from_part = pair.in_part->cam_from_world;
    const Rigid3d scaled =
        Inverse(cam_from_rest) * Rigid3d(cam_from_part.rotation, scale * cam_from_part.translation);
    return Sim3d{scale, scaled.rotation, scaled.translation};
  }

  // Of points that matches say are one (RANSAC; Fischler and Bolles, 1981).
  std::optional<Sim3d> ByTriple(int64_t i) const {
    Rng rng(context_.run.seed, "place_part", i);
    std::array<uint32_t, 3> triple;
    rng.Sample(static_cast<uint32_t>(crossing_.rest_points.size()), 3, triple.data());
    std::vector<Eigen::Vector3d> of_rest, of_part;
    for (const uint32_t k : triple) {
      of_rest.push_back(crossing_.rest_points[k]);
      of_part.push_back(crossing_.part_points[k]);
    }
    return AlignSimilarity(of_part, of_rest);
  }

  const StageContext& context_;
  const Reconstruction& rest_;
  const Reconstruction& part_;
  const Crossing& crossing_;
};

// Images that a verified pair joins with one of these.
std::set<image_t> NeighborsOf(const std::set<image_t>& images, const Reconstruction& model,
                              const ViewGraph& graph) {
  std::set<image_t> neighbors;
  for (const ViewEdge& edge : graph.edges) {
    const bool has_first = images.contains(edge.image_id1);
    if (!IsWithin(edge, model) || has_first == images.contains(edge.image_id2)) continue;
    neighbors.insert(has_first ? edge.image_id2 : edge.image_id1);
  }
  return neighbors;
}

}  // namespace

Reconstruction PartOf(const Reconstruction& model, const std::set<image_t>& images,
                      const std::function<bool(image_t)>& is_of_part) {
  Reconstruction part;
  part.cameras = model.cameras;
  std::set<point3D_t> seen;
  for (const image_t id : images) {
    RegisteredImage image = model.images.at(id);
    seen.insert(image.point3D_ids.begin(), image.point3D_ids.end());
    std::fill(image.point3D_ids.begin(), image.point3D_ids.end(), kInvalidPoint3DId);
    part.images[id] = std::move(image);
  }
  seen.erase(kInvalidPoint3DId);
  for (const point3D_t id : seen) {
    Point3D point = model.points3D.at(id);
    std::erase_if(point.track, [&](const auto& element) { return !is_of_part(element.image_id); });
    if (point.track.size() < 2) continue;
    std::erase_if(point.track,
                  [&](const auto& element) { return !images.contains(element.image_id); });
    part.AddPoint3D(std::move(point));
  }
  return part;
}

PlaceOfPart PlacePart(StageContext& context, const ViewGraph& graph, const Reconstruction& rest,
                      const Reconstruction& part) {
  ModelStage stage(context, "place_part");
  const Crossing crossing = FindCrossing(context, graph, rest, part);
  const PlaceSearch search(context, rest, part, crossing);
  PlaceOfPart place = search.Find();
  place.num_sightings = static_cast<int>(search.NumSightings());
  place.num_before = search.NumAgreeing({});
  stage.Add("images", part.images.size());
  stage.Add("pairs", crossing.pairs.size());
  stage.Add("sightings", place.num_sightings);
  stage.Add("agreed_before", place.num_before);
  stage.Add("agree", place.num_agreeing);
  return place;
}

PartAndRest SplitOff(const BuiltModel& built, const std::set<image_t>& images) {
  const auto is_of_part = [&](image_t id) { return images.contains(id); };
  const std::set<image_t> neighbors = NeighborsOf(images, *built.model, built.graph);
  return {PartOf(*built.model, images, is_of_part),
          PartOf(*built.model, neighbors, std::not_fn(is_of_part))};
}

bool AreInPlace(const StageContext& context, const BuiltModel& built,
                const std::set<image_t>& images) {
  const PartAndRest split = SplitOff(built, images);
  const Crossing crossing = FindCrossing(context, built.graph, split.rest, split.part);
  const PlaceSearch search(context, split.rest, split.part, crossing);
  return 2 * search.NumAgreeing({}) > static_cast<int64_t>(search.NumSightings());
}

}  // namespace cairn
