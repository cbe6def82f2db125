#include <algorithm>
#include <array>
#include <tuple>

#include "cairn/base/parallel.h"
#include "cairn/base/rng.h"
#include "cairn/evaluation/alignment.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// A point of one model where a match has it in an image of the other.
struct Sighting {
  Eigen::Vector3d xyz;
  const RegisteredImage* image;
  point2D_t keypoint;
};

// What the matches between the images of two models say.
struct Crossing {
  std::vector<Sighting> in_rest;                          // points of the part
  std::vector<Sighting> in_part;                          // points of the rest
  std::vector<Eigen::Vector3d> rest_points, part_points;  // that a match says are one

  size_t NumSightings() const { return in_rest.size() + in_part.size(); }
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
  for (const ViewEdge& edge : graph.edges) {
    if (edge.removal == EdgeRemoval::kAmbiguous) continue;  // leads to another place
    const bool is_rest_first = rest.images.count(edge.image_id1) > 0;
    const image_t in_rest = is_rest_first ? edge.image_id1 : edge.image_id2;
    const image_t in_part = is_rest_first ? edge.image_id2 : edge.image_id1;
    if (rest.images.count(in_rest) == 0 || part.images.count(in_part) == 0) continue;
    for (const FeatureMatch& match : context.scene.matches.at(edge.PairId())) {
      finder.Add({in_rest, is_rest_first ? match.point1 : match.point2},
                 {in_part, is_rest_first ? match.point2 : match.point1});
    }
  }
  return finder.Find();
}

// Whether a sighting agrees with a similarity that takes its point to its image's world.
bool Agrees(const Sighting& sighting, const Sim3d& image_from_point, const Reconstruction& model,
            double max_error_px) {
  const RegisteredImage& image = *sighting.image;
  return ReprojectionErrorPx(model.CameraOf(image), image.cam_from_world,
                             image_from_point * sighting.xyz,
                             image.points2D[sighting.keypoint]) <= max_error_px;
}

// Searches the similarity with which most sightings agree.
class PlaceSearch {
 public:
  PlaceSearch(const StageContext& context, const Reconstruction& rest, const Reconstruction& part,
              const Crossing& crossing)
      : context_(context), rest_(rest), part_(part), crossing_(crossing) {}

  int NumAgreeing(const Sim3d& rest_from_part) const {
    const double max_error_px = context_.settings.resection.max_error_px;
    const Sim3d part_from_rest = Inverse(rest_from_part);
    int num_agreeing = 0;
    for (const Sighting& sighting : crossing_.in_rest) {
      num_agreeing += Agrees(sighting, rest_from_part, rest_, max_error_px);
    }
    for (const Sighting& sighting : crossing_.in_part) {
      num_agreeing += Agrees(sighting, part_from_rest, part_, max_error_px);
    }
    return num_agreeing;
  }

  // By triples of points that matches say are one (RANSAC; Fischler and Bolles, 1981).
  std::optional<Sim3d> Find() const {
    constexpr int kNumTriples = 3000;
    const auto num_points = static_cast<uint32_t>(crossing_.rest_points.size());
    if (num_points < 3) return std::nullopt;
    std::vector<std::optional<Sim3d>> found(kNumTriples);
    std::vector<int> num_agreeing(kNumTriples);
    ParallelFor(context_.run.num_threads, kNumTriples, [&](int64_t i) {
      Rng rng(context_.run.seed, "place_part", i);
      std::array<uint32_t, 3> triple;
      rng.Sample(num_points, 3, triple.data());
      std::vector<Eigen::Vector3d> of_rest, of_part;
      for (const uint32_t k : triple) {
        of_rest.push_back(crossing_.rest_points[k]);
        of_part.push_back(crossing_.part_points[k]);
      }
      found[i] = AlignSimilarity(of_part, of_rest);
      if (found[i]) num_agreeing[i] = NumAgreeing(*found[i]);
    });
    return found[std::max_element(num_agreeing.begin(), num_agreeing.end()) - num_agreeing.begin()];
  }

 private:
  const StageContext& context_;
  const Reconstruction& rest_;
  const Reconstruction& part_;
  const Crossing& crossing_;
};

}  // namespace

Reconstruction PartOf(const Reconstruction& model, const std::set<image_t>& images) {
  Reconstruction part;
  part.cameras = model.cameras;
  for (const image_t id : images) {
    RegisteredImage image = model.images.at(id);
    std::fill(image.point3D_ids.begin(), image.point3D_ids.end(), kInvalidPoint3DId);
    part.images[id] = std::move(image);
  }
  for (const auto& [id, point] : model.points3D) {
    Point3D within = point;
    std::erase_if(within.track, [&](const auto& e) { return images.count(e.image_id) == 0; });
    if (within.track.size() >= 2) part.AddPoint3D(within);
  }
  return part;
}

std::optional<Sim3d> PlacePart(StageContext& context, const ViewGraph& graph,
                               const Reconstruction& rest, const Reconstruction& part) {
  ModelStage stage(context, "place_part");
  const Crossing crossing = FindCrossing(context, graph, rest, part);
  const PlaceSearch search(context, rest, part, crossing);
  const int num_before = search.NumAgreeing({});
  const std::optional<Sim3d> rest_from_part = search.Find();
  const int num_agreeing = rest_from_part ? search.NumAgreeing(*rest_from_part) : 0;
  stage.Add("images", part.images.size());
  stage.Add("sightings", crossing.NumSightings());
  stage.Add("agreed_before", num_before);
  stage.Add("agree", num_agreeing);
  return num_agreeing > num_before ? rest_from_part : std::nullopt;
}

}  // namespace cairn
