#include "cairn/math/so3.h"
#include "support/check_consistency.h"
#include "unit/mapper/incomplete_model.h"

namespace cairn {
namespace {

const std::set<image_t> kRest = {1, 2, 3, 4, 5, 6, 7}, kPart = {8, 9, 10};
bool IsOfPart(image_t id) { return kPart.count(id) > 0; }
bool IsOfRest(image_t id) { return kRest.count(id) > 0; }
const Sim3d kMoved{1.7, Eigen::Quaterniond(ExpSO3({0.4, -1.1, 0.6})), {3, -2, 5}};

// The true model in two; the part in a frame of its own. Few matches are left between them, and a
// quarter of these is wrong.
struct TwoModels : IncompleteModel {
  explicit TwoModels(size_t num_kept = 12, const SceneOptions& options = SmallScene())
      : IncompleteModel({}, 1, options),
        rest(PartOf(model, kRest, IsOfRest)),
        part(PartOf(model, kPart, IsOfPart)) {
    part.Transform(kMoved);
    for (auto& [pair_id, matches] : scene.matches) {
      const auto [id1, id2] = PairIdToImagePair(pair_id);
      if (kRest.count(id1) == kRest.count(id2)) continue;
      matches.resize(std::min(matches.size(), num_kept));
      for (size_t i = 0; i + 3 < matches.size(); i += 8) {
        std::swap(matches[i].point2, matches[i + 2].point2);
      }
    }
  }
  Reconstruction rest, part;
};

// Centers are of the order of 1.
void ExpectTruePoses(const IncompleteModel& scene, double max_error_deg, double max_center_error) {
  for (const auto& [id, image] : scene.model.images) {
    EXPECT_LT(scene.RotationErrorDeg(id), max_error_deg) << id;
    EXPECT_LT(scene.CenterError(id), max_center_error) << id;
  }
}

int NumWarnings(const std::vector<ResultWarning>& warnings, const std::string& what) {
  return std::count_if(warnings.begin(), warnings.end(), [&](const ResultWarning& warning) {
    return warning.what.find(what) != std::string::npos;
  });
}

TEST(PartOf, HasThePointsThatTwoOfItsImagesSee) {
  const IncompleteModel scene({});
  const Reconstruction part = PartOf(scene.model, kPart, IsOfPart);
  CheckConsistency(part);
  EXPECT_EQ(part.images.size(), kPart.size());
  size_t num_expected = 0;
  for (const auto& [id, point] : scene.model.points3D) {
    num_expected += std::count_if(point.track.begin(), point.track.end(), [](const auto& element) {
                      return kPart.count(element.image_id) > 0;
                    }) >= 2;
  }
  EXPECT_GT(num_expected, 0u);
  EXPECT_EQ(part.points3D.size(), num_expected);
}

TEST(PlacePart, FindsThePlaceAmongWrongMatches) {
  TwoModels scene;
  const PlaceOfPart place = PlacePart(scene.context, scene.graph, scene.rest, scene.part);
  EXPECT_GT(place.num_agreeing, place.num_sightings / 2);
  EXPECT_EQ(place.num_before, 0);
  scene.model = scene.part;
  scene.model.Transform(place.rest_from_part);
  ExpectTruePoses(scene, 1.0, 0.1);
}

TEST(PlacePart, NoMoreAgreeThanWhereAPartIsInItsPlace) {
  TwoModels scene;
  scene.part.Transform(Inverse(kMoved));
  const PlaceOfPart place = PlacePart(scene.context, scene.graph, scene.rest, scene.part);
  EXPECT_GT(place.num_before, 0);
  EXPECT_LE(place.num_agreeing, place.num_before);
}

// No match is of a point of both: one pair's relative pose, and points of each that the other one's
// image shows, are enough.
TEST(PlacePart, OnePairAndPointsOfOneModelAreEnough) {
  TwoModels scene(1000);
  for (auto& [pair_id, matches] : scene.scene.matches) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    if (kRest.count(id1) == kRest.count(id2)) continue;
    if (id1 != 7 || id2 != 8) matches.clear();
    for (size_t i = 0; i < matches.size(); ++i) {
      const TrackElement at =
          i % 2 == 0 ? TrackElement{7, matches[i].point1} : TrackElement{8, matches[i].point2};
      Reconstruction& model = i % 2 == 0 ? scene.rest : scene.part;
      const point3D_t point = model.images.at(at.image_id).point3D_ids[at.point2D];
      if (point != kInvalidPoint3DId) model.RemovePoint3D(point);
    }
  }
  const PlaceOfPart place = PlacePart(scene.context, scene.graph, scene.rest, scene.part);
  EXPECT_GT(place.num_agreeing, place.num_sightings / 2);
  scene.model = scene.part;
  scene.model.Transform(place.rest_from_part);
  ExpectTruePoses(scene, 1.0, 0.1);
}

TEST(GroupsOfOwnScale, APartThatSharesNoPointsIsOne) {
  TwoModels scene;
  EXPECT_TRUE(FindGroupsOfOwnScale(scene.context, scene.Built()).empty());
  for (const image_t id : kPart) RemoveImage(id, scene.model);
  for (auto& [id, image] : scene.part.images) {
    std::fill(image.point3D_ids.begin(), image.point3D_ids.end(), kInvalidPoint3DId);
    scene.model.images[id] = image;
  }
  scene.model.cameras.insert(scene.part.cameras.begin(), scene.part.cameras.end());
  for (const auto& [id, point] : scene.part.points3D) scene.model.AddPoint3D(point);
  const auto groups = FindGroupsOfOwnScale(scene.context, scene.Built());
  ASSERT_EQ(groups.size(), 1u);
  EXPECT_EQ(groups[0].images, kPart);
  EXPECT_EQ(NumWarnings(JudgeModel(scene.context, scene.Built()), "since few points join them (3)"),
            1);
}

// The points of each are where the images of the other show them, though no point is of both.
void ExpectNoWarningOfAPartInItsPlace(const SceneOptions& options) {
  TwoModels scene(1000, options);
  scene.part.Transform(Inverse(kMoved));
  scene.model.points3D.clear();
  for (const Reconstruction* model : {&scene.rest, &scene.part}) {
    for (const auto& [id, image] : model->images) {
      scene.model.images[id] = image;
      std::ranges::fill(scene.model.images[id].point3D_ids, kInvalidPoint3DId);
    }
  }
  for (const Reconstruction* model : {&scene.rest, &scene.part}) {
    for (const auto& [id, point] : model->points3D) scene.model.AddPoint3D(point);
  }
  EXPECT_EQ(FindGroupsOfOwnScale(scene.context, scene.Built()).size(), 1u);
  EXPECT_EQ(NumWarnings(JudgeModel(scene.context, scene.Built()), "since few points join"), 0);
}

TEST(GroupsOfOwnScale, APartInItsPlaceIsNoWarning) {
  ExpectNoWarningOfAPartInItsPlace(SmallScene());
}

// Keypoints of photographs that were matched at a quarter of their size are four times as far off.
TEST(GroupsOfOwnScale, APartInItsPlaceIsNoWarningInLargePhotographs) {
  SceneOptions options = SmallScene();
  options.image_width = 12800;
  options.image_height = 9600;
  options.image_noise_px = 4 * 1.6;
  ExpectNoWarningOfAPartInItsPlace(options);
}

// As after bundle adjustment without a point in common: the part lies anywhere.
TEST(ReplaceMisplaced, PlacesAPartAsAWhole) {
  TwoModels scene;
  for (const image_t id : kPart) {
    scene.model.images.at(id).cam_from_world = scene.part.images.at(id).cam_from_world;
  }
  BuiltModel built = scene.Built();
  ReviseEdges(built.evidence, *built.model, built.graph);
  ASSERT_TRUE(FitAndRefine(scene.context, TracksOfGraph(scene.context, built.graph).tracks,
                           RefineStart::kChanged, *built.model));
  built.evidence = EvidenceFor(scene.context, *built.model, built.graph);
  ReplaceMisplaced(scene.context, built);
  EXPECT_EQ(built.model->images.size(), kRest.size() + kPart.size());
  EXPECT_EQ(built.evidence.num_contradicted, 0);
}

SceneOptions Street() {
  SceneOptions options = SmallScene();
  options.layout = CameraLayout::kStreet;
  options.num_points = 3000;
  options.max_keypoints = 2000;
  return options;
}

// How long the way from one image to another is beside that from 4 to 7.
double RelativeLength(const Reconstruction& model, image_t from, image_t to) {
  const auto distance = [&](image_t id1, image_t id2) {
    return (model.images.at(id1).cam_from_world.Center() -
            model.images.at(id2).cam_from_world.Center())
        .norm();
  };
  return distance(from, to) / distance(4, 7);
}

// A street whose cameras stand on a straight line. An image lacks every third point.
struct StraightStreet : IncompleteModel {
  StraightStreet() : IncompleteModel({}, 1, Street()) {
    for (auto& [id, image] : truth.images) {
      const double x = image.cam_from_world.Center().x();
      MoveTo({x, -3, 0}, image.cam_from_world);
      for (size_t i = 0; i < image.points2D.size(); ++i) {
        const auto point = truth.points3D.find(image.point3D_ids[i]);
        if (point == truth.points3D.end()) continue;
        const auto pixel =
            truth.CameraOf(image).ImgFromRay(image.cam_from_world * point->second.xyz);
        if (pixel) image.points2D[i] = *pixel;
      }
      scene.pixels[id] = image.points2D;
    }
    for (auto& [pair_id, matches] : scene.matches) {
      const auto [id1, id2] = PairIdToImagePair(pair_id);
      std::erase_if(matches, [&, id1 = id1, id2 = id2](const FeatureMatch& match) {
        const point3D_t point = truth.images.at(id1).point3D_ids[match.point1];
        return (point + id1) % 3 == 0 || (point + id2) % 3 == 0;
      });
    }
    model = truth;
  }

  // Images at one end come nearer to the one beside them.
  void Shrink(const std::set<image_t>& part, image_t beside) {
    const Eigen::Vector3d center = truth.images.at(beside).cam_from_world.Center();
    for (const image_t id : part) {
      Rigid3d& pose = model.images.at(id).cam_from_world;
      MoveTo(center + 0.05 * (pose.Center() - center), pose);
    }
  }
  void ExpectLengthOf(const Reconstruction& built, image_t from, image_t to) const {
    EXPECT_NEAR(RelativeLength(built, from, to) / RelativeLength(truth, from, to), 1.0, 0.05);
  }

  static void MoveTo(const Eigen::Vector3d& center, Rigid3d& cam_from_world) {
    cam_from_world.translation = -(cam_from_world.rotation * center);
  }
};

// Relative poses agree with a part of any size, on a straight line.
TEST(ReplaceMisplaced, GivesAPartItsScaleBack) {
  StraightStreet scene;
  EXPECT_TRUE(FindGroupsOfOwnScale(scene.context, scene.Built()).empty());
  scene.Shrink({9, 10}, 8);
  TriangulateModel(scene.context, TracksOfGraph(scene.context, scene.graph).tracks, scene.model);
  BuiltModel built = scene.Built();
  EXPECT_EQ(built.evidence.num_contradicted, 0);
  const auto groups = FindGroupsOfOwnScale(scene.context, built);
  ASSERT_EQ(groups.size(), 1u);
  EXPECT_EQ(groups[0].images, (std::set<image_t>{9, 10}));
  const std::string warning = "since few points join them (2)";
  EXPECT_EQ(NumWarnings(JudgeModel(scene.context, built), warning), 1);
  ReplaceMisplaced(scene.context, built);
  scene.ExpectLengthOf(*built.model, 8, 10);
  EXPECT_EQ(NumWarnings(JudgeModel(scene.context, built), warning), 0);
}

// Each repair is a round of its own; they end where none is left, not after a number.
TEST(ReplaceMisplaced, GoesOnWhileSomethingIsGained) {
  StraightStreet scene;
  scene.settings.reconstruct.max_rounds = 1;
  scene.Shrink({1, 2}, 3);
  scene.Shrink({9, 10}, 8);
  TriangulateModel(scene.context, TracksOfGraph(scene.context, scene.graph).tracks, scene.model);
  BuiltModel built = scene.Built();
  EXPECT_EQ(FindGroupsOfOwnScale(scene.context, built).size(), 2u);
  ReplaceMisplaced(scene.context, built);
  scene.ExpectLengthOf(*built.model, 1, 3);
  scene.ExpectLengthOf(*built.model, 8, 10);
}

}  // namespace
}  // namespace cairn
