#include "view_graph/duplicate_structure.h"

#include <functional>
#include <numeric>
#include <set>

#include "cairn/base/rng.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/synthetic/scene.h"
#include "support/check_consistency.h"
#include "support/scene_view_graph.h"
#include "support/test.h"

namespace cairn {
namespace {

using Pairs = std::set<std::pair<image_t, image_t>>;

// A model with its graph. Of twin places, images of even ids show one and those of odd ids the
// other, on top of it.
struct Place {
  Reconstruction model;
  ViewGraph graph;

  Place() = default;
  Place(CameraLayout layout, bool is_twin, uint64_t seed, int num_images = 16) {
    SceneOptions options;
    options.layout = layout;
    options.num_images = num_images;
    options.num_points = 2000;
    options.image_noise_px = 0.3;
    options.twin_places = is_twin;
    const SyntheticScene scene = MakeScene(options, seed);
    model = scene.truth;
    graph = MakeViewGraph(scene);
  }

  DuplicateStructure Find(int num_threads = 1) const {
    return FindDuplicateStructure(model, graph, {.num_threads = num_threads});
  }
  Pairs BetweenDuplicates(int num_threads = 1) const {
    Pairs pairs;
    for (const size_t e : Find(num_threads).edges) {
      pairs.insert({graph.edges[e].image_id1, graph.edges[e].image_id2});
    }
    return pairs;
  }
  Pairs BetweenEvenAndOdd() const {
    Pairs pairs;
    for (const ViewEdge& edge : graph.edges) {
      if (edge.image_id1 % 2 != edge.image_id2 % 2) pairs.insert({edge.image_id1, edge.image_id2});
    }
    return pairs;
  }
};

TEST(DuplicateStructure, APlaceAloneIsOne) {
  for (const CameraLayout layout : {CameraLayout::kArc, CameraLayout::kRing}) {
    for (const uint64_t seed : {1, 2, 3}) {
      const Place place(layout, false, seed);
      ASSERT_EQ(place.model.images.size(), 16u);
      ASSERT_GT(place.BetweenEvenAndOdd().size(), 20u);
      EXPECT_TRUE(place.BetweenDuplicates().empty()) << static_cast<int>(layout) << " " << seed;
      EXPECT_FALSE(place.Find().IsDoubtful());
    }
  }
}

TEST(DuplicateStructure, TwoPlacesWithACommonPartAreSplit) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Place place(CameraLayout::kArc, true, seed);
    const Pairs expected = place.BetweenEvenAndOdd();
    ASSERT_GT(expected.size(), 20u);
    ASSERT_GT(place.graph.edges.size(), expected.size() + 20);
    EXPECT_EQ(place.BetweenDuplicates(), expected) << seed;
  }
}

// The place with other things near one of its points in the images with these ids, as after
// something was moved: what was there is matched among these images and among the others.
Place WithChange(Place place, const std::set<image_t>& later, double radius, Rng& rng) {
  const auto& points = place.model.points3D;
  const auto any = std::next(points.begin(), rng.UniformInt(static_cast<uint32_t>(points.size())));
  const Eigen::Vector3d middle = any->second.xyz;
  std::vector<Point3D> moved;
  for (const auto& [id, point] : points) {
    if ((point.xyz - middle).norm() < radius) moved.push_back(point);
  }
  for (const Point3D& point : moved) {
    const TrackElement& first = point.track.front();
    place.model.RemovePoint3D(place.model.images.at(first.image_id).point3D_ids[first.point2D]);
    Point3D before = point, after = point;
    std::erase_if(before.track, [&](const TrackElement& e) { return later.count(e.image_id) > 0; });
    std::erase_if(after.track, [&](const TrackElement& e) { return later.count(e.image_id) == 0; });
    for (const Point3D& part : {before, after}) {
      if (part.track.size() >= 2) place.model.AddPoint3D(part);
    }
  }
  return place;
}

TEST(DuplicateStructure, APlaceThatChangedALittleIsOne) {
  for (const uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    Rng rng(seed);
    const Place before(CameraLayout::kArc, false, seed);
    const Place place = WithChange(before, {2, 7, 12}, 0.5, rng);
    ASSERT_LT(place.model.NumObservations(), before.model.NumObservations());
    EXPECT_TRUE(place.BetweenDuplicates().empty()) << seed;
  }
}

// Photographs of a wall of 20 x 20 points, one beside the other.
struct Wall : Place {
  explicit Wall(int num_images) {
    model.cameras[1] = Camera::FromFocal(1, CameraModel::kSimplePinhole, 1000, 1000, 1000);
    for (int i = 1; i <= num_images; ++i) {
      RegisteredImage& image = model.images[i];
      image.image = {static_cast<image_t>(i), std::to_string(i), 1};
      image.cam_from_world.translation.x() = -0.01 * i;
      graph.image_ids.push_back(i);
    }
  }
  // A point that these images see.
  void AddPoint(int k, const std::function<bool(int)>& is_seen_by) {
    Point3D point;
    point.xyz = {(k % 20 - 9.5) / 2.1, (k / 20 - 9.5) / 2.1, 10};
    for (auto& [id, image] : model.images) {
      if (!is_seen_by(static_cast<int>(id))) continue;
      point.track.push_back({id, static_cast<point2D_t>(image.points2D.size())});
      image.points2D.push_back(*model.cameras[1].ImgFromRay(image.cam_from_world * point.xyz));
      image.point3D_ids.push_back(kInvalidPoint3DId);
    }
    model.AddPoint3D(point);
  }
  void AddPair(int i, int j) {
    ViewEdge edge;
    edge.image_id1 = i;
    edge.image_id2 = j;
    edge.num_inliers = 100;
    graph.edges.push_back(edge);
    graph.Normalize();
  }
};

// A wall before (16 images) and after (3) half of it was painted, with one pair between them: too
// few to be proven another place. An image without pairs changes nothing about that.
TEST(DuplicateStructure, AnImageAloneKeepsNoOthersApart) {
  constexpr int kBefore = 16, kPaired = 19, kAll = 20;
  Wall wall(kAll);
  const auto is_after = [](int i) { return i > kBefore && i <= kPaired; };
  for (int k = 0; k < 400; ++k) {
    if (k % 20 < 10) {
      wall.AddPoint(k, [](int) { return true; });
    } else {
      wall.AddPoint(k, [&](int i) { return !is_after(i); });
      wall.AddPoint(k, is_after);
    }
  }
  for (int i = 1; i <= kPaired; ++i) {
    for (int j = i + 1; j <= kPaired; ++j) {
      if (is_after(i) == is_after(j) || (i == kBefore && j == kBefore + 1)) wall.AddPair(i, j);
    }
  }
  EXPECT_TRUE(wall.BetweenDuplicates().empty());
}

// Two doors, of which one half looks alike, and matches badly: not by chance is nothing of the
// other half matched.
TEST(DuplicateStructure, PlacesWhoseCommonPartMatchesBadlyAreTwo) {
  Wall doors(16);
  Rng rng(1);
  const auto is_other = [](int i) { return i > 8; };
  size_t num_between = 0;
  for (int k = 0; k < 400; ++k) {
    if (k % 20 < 10 && rng.Uniform(0, 1) < 0.15) {
      doors.AddPoint(k, [](int) { return true; });
    } else {
      doors.AddPoint(k, [&](int i) { return !is_other(i); });
      doors.AddPoint(k, is_other);
    }
  }
  for (int i = 1; i <= 16; ++i) {
    for (int j = i + 1; j <= 16; ++j) {
      doors.AddPair(i, j);
      num_between += is_other(i) != is_other(j);
    }
  }
  const DuplicateStructure found = doors.Find();
  EXPECT_EQ(found.edges.size(), num_between);
  EXPECT_EQ(found.num_conflicting, static_cast<int>(num_between));
}

TEST(DuplicateStructure, EdgesOutOfUseAreNotJudged) {
  Place place(CameraLayout::kArc, true, 1);
  const Pairs all = place.BetweenDuplicates();
  ASSERT_GT(all.size(), 20u);
  for (ViewEdge& edge : place.graph.edges) {
    if (edge.image_id1 % 2 != edge.image_id2 % 2 && edge.image_id1 <= 2) {
      edge.removal = EdgeRemoval::kTooFewInliers;
    }
  }
  const Pairs rest = place.BetweenDuplicates();
  EXPECT_LT(rest.size(), all.size());
  EXPECT_GT(rest.size(), all.size() / 2);
  for (const auto& [id1, id2] : rest) EXPECT_GT(id1, 2u);
}

// The same place with image k called new_id[k], and its points by other ids.
Place Renumbered(Place place, const std::vector<image_t>& new_id) {
  const auto new_point_id = [](point3D_t id) {
    return id == kInvalidPoint3DId ? id : 1000000 - id;
  };
  Reconstruction renumbered;
  renumbered.cameras = place.model.cameras;
  for (const auto& [id, image] : place.model.images) {
    RegisteredImage& moved = renumbered.images[new_id[id]] = image;
    moved.image.image_id = new_id[id];
    for (point3D_t& point : moved.point3D_ids) point = new_point_id(point);
  }
  for (auto [id, point] : place.model.points3D) {
    for (TrackElement& element : point.track) element.image_id = new_id[element.image_id];
    std::sort(point.track.begin(), point.track.end());
    renumbered.points3D[new_point_id(id)] = point;
  }
  CheckConsistency(renumbered);
  place.model = std::move(renumbered);
  for (image_t& id : place.graph.image_ids) id = new_id[id];
  for (ViewEdge& edge : place.graph.edges) {
    edge.image_id1 = new_id[edge.image_id1];
    edge.image_id2 = new_id[edge.image_id2];
    if (edge.image_id1 < edge.image_id2) continue;
    std::swap(edge.image_id1, edge.image_id2);
    edge.cam2_from_cam1 = Inverse(edge.cam2_from_cam1);
  }
  place.graph.Normalize();
  return place;
}

TEST(DuplicateStructure, NumbersOfImagesAndPointsDoNotMatter) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Place place(CameraLayout::kArc, true, seed);
    std::vector<image_t> new_id(17);
    std::iota(new_id.begin(), new_id.end(), 100);
    Rng(seed).Shuffle(new_id);
    Pairs expected;
    for (const auto& [id1, id2] : place.BetweenDuplicates()) {
      expected.insert(std::minmax(new_id[id1], new_id[id2]));
    }
    ASSERT_FALSE(expected.empty());
    EXPECT_EQ(Renumbered(place, new_id).BetweenDuplicates(), expected) << seed;
  }
}

// Around a ring, neighbors of one place are too far apart to show the same, so that nothing tells
// how much they conflict, and no group is proven. Those of two places conflict all the same.
TEST(DuplicateStructure, TwinsThatCannotBeToldApartAreDoubtful) {
  for (const uint64_t seed : {1, 2, 3}) {
    const DuplicateStructure found = Place(CameraLayout::kRing, true, seed, 24).Find();
    EXPECT_TRUE(found.edges.empty());
    EXPECT_TRUE(found.IsDoubtful()) << found.num_conflicting << " of " << found.num_told;
    EXPECT_GT(found.images.size(), 5u);
  }
}

TEST(DuplicateStructure, NorDoesTheFrameOfTheModel) {
  Place place(CameraLayout::kArc, true, 1);
  const Pairs expected = place.BetweenDuplicates();
  ASSERT_FALSE(expected.empty());
  place.model.Transform(
      {3.0, Eigen::Quaterniond(0.5, -0.5, 0.1, 0.7).normalized(), Eigen::Vector3d(10, -20, 5)});
  EXPECT_EQ(place.BetweenDuplicates(), expected);
}

TEST(DuplicateStructure, NorDoesTheNumberOfThreads) {
  const Place place(CameraLayout::kArc, true, 1);
  const std::vector<size_t> one = place.Find(1).edges;
  ASSERT_FALSE(one.empty());
  EXPECT_EQ(place.Find(4).edges, one);
}

TEST(DuplicateStructure, NothingHasNone) {
  EXPECT_TRUE(FindDuplicateStructure({}, {}, {.num_threads = 1}).edges.empty());
  Place place(CameraLayout::kArc, true, 1);
  place.model.images.clear();
  EXPECT_TRUE(place.BetweenDuplicates().empty());
}

}  // namespace
}  // namespace cairn
