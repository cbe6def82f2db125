#include "cairn/math/so3.h"
#include "unit/mapper/incomplete_model.h"

namespace cairn {
namespace {

TEST(MisplacedGroups, ARightModelHasNone) {
  IncompleteModel scene({});
  EXPECT_TRUE(FindMisplacedGroups(scene.context, scene.Built()).empty());
}

// Images 8 to 10 lie right to each other, and wrong to the others. Each keeps most of its matches:
// nine in ten of those with the others are taken away.
TEST(MisplacedGroups, AGroupIsFoundThoughEachOfItsImagesKeepsMostMatches) {
  IncompleteModel scene({});
  const Rigid3d turn(ExpSO3({0, 0.3, 0}), Eigen::Vector3d(0.5, 0.2, 0));
  for (auto& [id, image] : scene.model.images) {
    if (id >= 8) image.cam_from_world = image.cam_from_world * turn;
  }
  for (auto& [pair_id, matches] : scene.scene.matches) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    if (id1 < 8 && id2 >= 8) matches.resize(matches.size() / 10);
  }
  const BuiltModel built = scene.Built();
  for (const image_t id : {8, 9, 10}) EXPECT_FALSE(built.evidence.images.at(id).IsContradicted());
  const auto groups = FindMisplacedGroups(scene.context, built);
  ASSERT_EQ(groups.size(), 1u);
  EXPECT_EQ(groups[0].images, (std::set<image_t>{8, 9, 10}));
}

// Points of images 8 to 10 are no points of images 1 to 6, though their pairs are verified.
TEST(Hinged, APartThatASingleImageJoinsWithTheRestIsFound) {
  IncompleteModel scene({});
  EXPECT_TRUE(FindHinged(scene.context, scene.graph, scene.model).empty());
  for (auto& [id, point] : scene.model.points3D) {
    const bool is_even = id % 2 == 0;
    const auto is_of_others = [&](const TrackElement& element) {
      return is_even ? element.image_id < 7 : element.image_id > 7;
    };
    for (const TrackElement& element : point.track) {
      if (!is_of_others(element)) continue;
      scene.model.images.at(element.image_id).point3D_ids[element.point2D] = kInvalidPoint3DId;
    }
    std::erase_if(point.track, is_of_others);
  }
  EXPECT_EQ(FindHinged(scene.context, scene.graph, scene.model), (std::set<image_t>{8, 9, 10}));
}

// First the points, then not even these join images 8 to 10 with the others, then one pair does.
TEST(FindApart, PartsThatNeitherPairsNorPointsJoin) {
  IncompleteModel scene({});
  const auto apart = [&] { return FindApart(scene.graph, scene.model); };
  ViewEdge* across = nullptr;
  for (ViewEdge& edge : scene.graph.edges) {
    if (edge.image_id1 >= 8 || edge.image_id2 < 8) continue;
    across = &edge;
    edge.removal = EdgeRemoval::kModelInconsistent;
  }
  EXPECT_TRUE(apart().empty());
  const std::map<point3D_t, Point3D> points = scene.model.points3D;
  for (const auto& [id, point] : points) {
    const auto is_of_part = [](const TrackElement& element) { return element.image_id >= 8; };
    if (std::ranges::any_of(point.track, is_of_part) &&
        !std::ranges::all_of(point.track, is_of_part)) {
      scene.model.RemovePoint3D(id);
    }
  }
  EXPECT_THAT(apart(), ElementsAre(std::set<image_t>{8, 9, 10}));
  across->removal = EdgeRemoval::kNone;
  EXPECT_TRUE(apart().empty());
}

TEST(JudgeModel, NamesImagesWithLongerFocalLengthsThanLensesHave) {
  IncompleteModel scene({});
  const camera_t id = scene.model.images.at(3).image.camera_id;
  Camera& camera = scene.model.cameras.at(id);
  const auto is_named = [&](double sides, bool has_exif) {
    camera.SetMeanFocal(sides * std::max(camera.width, camera.height));
    scene.scene.cameras.at(id).has_prior_focal_length = has_exif;
    return std::ranges::any_of(
        JudgeModel(scene.context, scene.Built()), [&](const ResultWarning& warning) {
          return warning.what.find("7.0 larger sides (1)") != std::string::npos &&
                 warning.what.ends_with(scene.scene.images.at(3).name);
        });
  };
  EXPECT_TRUE(is_named(7, false));
  EXPECT_FALSE(is_named(7, true));
  EXPECT_FALSE(is_named(6.5, false));
}

// What only images 9 and 10 see tells the direction between them, and not how far they are apart.
TEST(JudgeModel, NamesImagesWhosePointsLeaveTheirPositionOpen) {
  IncompleteModel scene({});
  const auto names_10 = [&] {
    return std::ranges::any_of(
        JudgeModel(scene.context, scene.Built()), [&](const ResultWarning& warning) {
          return warning.what.find("their points do not tell (1)") != std::string::npos &&
                 warning.what.ends_with(scene.scene.images.at(10).name);
        });
  };
  EXPECT_FALSE(names_10());
  const std::map<point3D_t, Point3D> points = scene.model.points3D;
  for (const auto& [id, point] : points) {
    const auto sees = [&](image_t image) {
      return std::ranges::any_of(point.track,
                                 [&](const auto& element) { return element.image_id == image; });
    };
    if (!sees(10)) continue;
    for (const TrackElement& element : point.track) {
      const bool is_of_others = element.image_id < 9;
      if (sees(9) == is_of_others) scene.model.RemoveObservation(id, element);
    }
  }
  EXPECT_TRUE(names_10());
}

}  // namespace
}  // namespace cairn
