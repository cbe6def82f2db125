// Places in one database that share neither pairs nor cameras.
#include <algorithm>

#include "cairn/math/so3.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "unit/mapper/camera_each.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

// Adds a place with ids from first_id, and names of its own.
void AddPlace(const Database& place, image_t first_id, Database& database) {
  const std::string folder = std::to_string(first_id) + "/";
  for (Camera camera : place.ReadCameras()) {
    camera.camera_id += first_id;
    database.WriteCamera(camera);
  }
  for (Image image : place.ReadImages()) {
    const image_t id = image.image_id;
    image.image_id += first_id;
    image.camera_id += first_id;
    image.name = folder + image.name;
    database.WriteImage(image);
    database.WriteKeypoints(image.image_id, *place.ReadKeypoints(id));
  }
  for (const auto& [pair_id, num_inliers] : place.ReadNumInliers()) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    database.WriteTwoViewGeometry(ImagePairToPairId(id1 + first_id, id2 + first_id),
                                  *place.ReadTwoViewGeometry(pair_id));
  }
}

Database Place(int num_images, uint64_t seed, int num_cameras = 2) {
  SceneOptions options = SmallScene();
  options.num_cameras = num_cameras;
  options.num_images = num_images;
  return MakeDatabase(MakeScene(options, seed));
}

Database PlaceOfOneCamera() { return WithACameraEach(SceneOfOneCamera(), 1.4); }

Database PlaceOfZoomedPhotographs() {
  SceneOptions options = SmallScene();
  options.num_images = 14;
  options.num_cameras = 1;
  const SyntheticScene scene = MakeScene(options, 4);
  Database database = WithACameraEach(scene, 1.2);
  ZoomEach(scene, database);
  return database;
}

Database Together(const std::vector<const Database*>& places) {
  Database database(":memory:");
  for (size_t k = 0; k < places.size(); ++k) {
    AddPlace(*places[k], static_cast<image_t>(1000 * (k + 1)), database);
  }
  return database;
}

TEST(Parts, GiveAModelEach) {
  const Database first = Place(6, 5), second = Place(8, 6);
  const Database database = Together({&first, &second});
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 2u);
  EXPECT_EQ(result.models[0].images.size(), 8u);
  EXPECT_EQ(result.models[1].images.size(), 6u) << ToJson(result.report);
  EXPECT_EQ(result.graph.image_ids.size(), 14u);
  EXPECT_EQ(result.graph.edges.size(), database.ReadNumInliers().size());
}

TEST(Parts, NoMoreThanTheOptionsAllow) {
  const Database first = Place(6, 5), second = Place(8, 6);
  const Database database = Together({&first, &second});
  ReconstructSettings one_model, large_models;
  one_model.reconstruct.max_models = 1;
  large_models.reconstruct.min_model_images = 7;
  for (const ReconstructSettings& settings : {one_model, large_models}) {
    const ReconstructResult result = Reconstruct(database, settings);
    ASSERT_EQ(result.models.size(), 1u);
    EXPECT_EQ(result.models[0].images.size(), 8u);
    const StageReport* left_out = FindStage(result.report, "left_out");
    ASSERT_NE(left_out, nullptr);
    EXPECT_EQ(Value(*left_out, "small_components"), 1);
    EXPECT_EQ(Value(*left_out, "images"), 6);
    ASSERT_EQ(left_out->messages.size(), 1u);
    EXPECT_THAT(left_out->messages[0], HasSubstr("6 connected images"));
    EXPECT_THAT(left_out->messages[0], HasSubstr("1000/image00000.jpg"));
  }
}

// Three photographs of one camera, of which a pair shows two.
TEST(Parts, AFewImagesThatACameraJoinsAreNoModel) {
  const Database first = Place(8, 6);
  Database second = Place(3, 5);
  for (Image image : second.ReadImages()) {
    image.camera_id = 1;
    second.WriteImage(image);
  }
  for (const image_t id : {1, 2}) second.DeletePairResults(ImagePairToPairId(id, 3));
  const ReconstructResult result = Reconstruct(Together({&first, &second}));
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(result.explained_shares.size(), 1u);
  EXPECT_EQ(result.models[0].images.size(), 8u);
}

// Photographs in a row of which no three show the same points: each pair has a scale of its own.
TEST(Parts, PairsOfAChainAreNoModels) {
  Database database = Place(6, 5);
  ChangeGeometries(database, [](image_t id1, image_t id2, TwoViewGeometry& geometry) {
    if (id2 != id1 + 1) geometry = {};
    std::erase_if(geometry.inlier_matches, [](const FeatureMatch& match) {
      return match.point1 % 2 != 0 || match.point2 % 2 == 0;
    });
  });
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 1u) << ToJson(result.report);
  EXPECT_EQ(result.models[0].images.size(), 2u);
  EXPECT_EQ(Value(*FindStage(result.report, "left_out"), "images"), 4);
}

// Two places, photographed with one camera.
Database PlacesOfOneCamera(int num_images1, int num_images2) {
  const Database first = Place(num_images1, 6, 1), second = Place(num_images2, 6, 1);
  Database both = Together({&first, &second});
  for (Image image : both.ReadImages()) {
    image.camera_id = 1001;
    both.WriteImage(image);
  }
  return both;
}

// Of one pair, pose and matches mean nothing.
TEST(Parts, AreNotHeldTogetherByAWrongPair) {
  Database database = PlacesOfOneCamera(12, 10);
  TwoViewGeometry wrong = *database.ReadTwoViewGeometry(ImagePairToPairId(1001, 1002));
  wrong.cam2_from_cam1 = Rigid3d(ExpSO3({0.3, 1.0, 0.2}), Eigen::Vector3d::UnitX());
  wrong.inlier_matches.clear();
  for (point2D_t k = 0; k < 200; ++k) wrong.inlier_matches.push_back({k, 7 * k % 201});
  database.WriteTwoViewGeometry(ImagePairToPairId(1003, 2003), wrong);
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 2u) << ToJson(result.report);
  EXPECT_EQ(result.models[0].images.size(), 12u);
  EXPECT_EQ(result.models[1].images.size(), 10u);
}

// Of one camera whose focal length is a guess: the smaller model alone finds another.
TEST(Parts, SmallModelsHaveTheIntrinsicsOfTheLargest) {
  const ReconstructResult result = Reconstruct(PlacesOfOneCamera(12, 7));
  ASSERT_EQ(result.models.size(), 2u);
  EXPECT_EQ(result.models[0].images.size(), 12u);
  EXPECT_EQ(result.models[1].images.size(), 7u);
  EXPECT_EQ(result.models[1].cameras.begin()->second.params,
            result.models[0].cameras.begin()->second.params);
}

// Input models of one camera are refined each, however large the others are.
TEST(Parts, InputModelsKeepNoIntrinsicsOfOthers) {
  const Database both = PlacesOfOneCamera(12, 11);
  std::vector<Reconstruction> models = Reconstruct(both).models;
  ASSERT_EQ(models.size(), 2u);
  const double focal = models[0].cameras.begin()->second.MeanFocal();
  for (Reconstruction& model : models) {
    for (auto& [id, camera] : model.cameras) camera.SetMeanFocal(1.03 * camera.MeanFocal());
  }
  const ReconstructResult result = Reconstruct(both, "", {}, kOneThread, models);
  ASSERT_EQ(result.models.size(), 2u);
  for (const Reconstruction& model : result.models) {
    EXPECT_NEAR(model.cameras.begin()->second.MeanFocal() / focal, 1, 0.005);
  }
}

TEST(Parts, OneThatFailsIsAWarning) {
  const Database first = Place(8, 6);
  Database second = Place(6, 5);
  ChangeGeometries(second, [](image_t, image_t, TwoViewGeometry& g) { MakePanoramic(g); });
  const ReconstructResult result = Reconstruct(Together({&second, &first}));
  EXPECT_EQ(result.report.failure, "");
  ASSERT_EQ(result.models.size(), 1u);
  ASSERT_EQ(result.report.warnings.size(), 1u);
  EXPECT_THAT(result.report.warnings[0].what,
              HasSubstr("no model of 6 images (1000/image00000.jpg"));
  EXPECT_THAT(result.report.warnings[0].what, HasSubstr("turned without moving"));
}

// One place is of one camera, the photographs of the other are of many: neither decides for the
// other.
TEST(Parts, AreAsIfTheyWereAlone) {
  const Database one = PlaceOfOneCamera(), zoomed = PlaceOfZoomedPhotographs();
  const ReconstructResult together = Reconstruct(Together({&one, &zoomed}));
  ASSERT_EQ(together.models.size(), 2u);
  EXPECT_EQ(IntrinsicsOf(together.models[0]).size(), 14u);
  EXPECT_EQ(IntrinsicsOf(together.models[1]).size(), 1u);
  Database one_alone(":memory:"), zoomed_alone(":memory:");
  AddPlace(one, 1000, one_alone);
  AddPlace(zoomed, 2000, zoomed_alone);
  const ReconstructResult first = Reconstruct(zoomed_alone), second = Reconstruct(one_alone);
  ExpectEqual(together.models[0], first.models.at(0));
  ExpectEqual(together.models[1], second.models.at(0));
  EXPECT_THAT(together.explained_shares,
              ElementsAre(first.explained_shares.at(0), second.explained_shares.at(0)));
}

TEST(Parts, AreTheSameSideBySide) {
  std::vector<Database> places;
  for (const uint64_t seed : {5, 6, 7, 8}) places.push_back(Place(6, seed));
  const Database database = Together({&places[0], &places[1], &places[2], &places[3]});
  const ReconstructResult one = Reconstruct(database);
  TestMonitor monitor;
  const ReconstructResult four =
      Reconstruct(database, "", {}, {.num_threads = 4, .monitor = monitor});
  ASSERT_EQ(one.models.size(), 4u);
  ASSERT_EQ(four.models.size(), 4u);
  for (size_t k = 0; k < 4; ++k) ExpectEqual(one.models[k], four.models[k]);
  ASSERT_EQ(one.report.stages.size(), four.report.stages.size());
  for (size_t i = 0; i < one.report.stages.size(); ++i) {
    EXPECT_EQ(one.report.stages[i].name, four.report.stages[i].name);
  }
  EXPECT_THAT(monitor.notes(), Contains("part 4 of 4: 6 images"));
  EXPECT_THAT(monitor.stages(), Contains("parts"));
}

// A camera that both places were taken with is calibrated once, by both.
TEST(Parts, ACameraJoins) {
  const Database first = Place(6, 5, 1), second = Place(8, 6, 1);
  Database database = Together({&first, &second});
  for (Image image : database.ReadImages()) {
    image.camera_id = 1001;
    database.WriteImage(image);
  }
  TestMonitor monitor;
  const ReconstructResult result =
      Reconstruct(database, "", {}, {.num_threads = 1, .monitor = monitor});
  EXPECT_THAT(monitor.stages(), Not(Contains("parts")));
  EXPECT_EQ(std::ranges::count(result.report.stages, "focal_calibration", &StageReport::name), 1);
  ASSERT_EQ(result.models.size(), 2u);
  const double focal_px = database.ReadCameras()[0].MeanFocal();
  for (const Reconstruction& model : result.models) {
    ASSERT_EQ(model.cameras.size(), 1u);
    EXPECT_NEAR(model.cameras.at(1001).MeanFocal() / focal_px, 1, 2e-3);
  }
}

TEST(Parts, StopKeepsPairsOfWhatWasNotBegun) {
  const Database first = Place(6, 5), second = Place(8, 6);
  const Database database = Together({&first, &second});
  TestMonitor monitor(0);
  const ReconstructResult result =
      Reconstruct(database, "", {}, {.num_threads = 1, .monitor = monitor});
  EXPECT_TRUE(result.models.empty());
  EXPECT_EQ(result.graph.edges.size(), database.ReadNumInliers().size());
}

}  // namespace
}  // namespace cairn
