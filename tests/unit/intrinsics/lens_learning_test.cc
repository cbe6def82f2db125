// Distortion and focal lengths that the likely pairs teach.
#include "intrinsics/lens_learning.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/synthetic/scene.h"
#include "intrinsics/known_intrinsics.h"
#include "intrinsics/shared_lenses.h"
#include "support/test.h"
#include "unit/intrinsics/learning_fixture.h"

namespace cairn {
namespace {

struct LensCase {
  double k = 0;
  double focal_factor = 1.0;  // what the database says of the true focal length
  bool has_prior = true;
  camera_t wrong_camera = kInvalidCameraId;  // the only one with that factor
  bool own_cameras = false;                  // one an image, 100 + its id
  int num_kinds = 2;                         // different focal lengths
  // (On a ring all optical axes meet in one point, which leaves focal lengths open.)
  CameraLayout layout_of_own = CameraLayout::kRing;
};

constexpr LensCase kOneKindAround = {.focal_factor = 1.3,
                                     .has_prior = false,
                                     .own_cameras = true,
                                     .num_kinds = 1,
                                     .layout_of_own = CameraLayout::kLandmark};

class LensLearningTest : public LearningTest {
 protected:
  // Two cameras with the same distortion, of which the database says nothing.
  std::string MakeDatabase(const std::string& name, const LensCase& lens) const {
    SceneOptions options;
    options.num_cameras = lens.num_kinds;
    options.num_images = lens.own_cameras ? 9 : 14;
    options.layout = lens.own_cameras ? lens.layout_of_own : CameraLayout::kLandmark;
    options.num_points = lens.own_cameras ? 900 : 1500;
    options.max_keypoints = 500;
    options.distance = lens.own_cameras ? 3.0 : 2.0;
    options.image_noise_px = lens.own_cameras ? 0.3 : 0.5;
    options.outlier_ratio = 0.2;
    options.camera_model = CameraModel::kSimpleRadial;
    options.radial_distortion = lens.k;
    SyntheticScene scene = MakeScene(options, 3);
    if (lens.own_cameras) {
      const std::map<camera_t, Camera> cameras = std::exchange(scene.cameras, {});
      for (Image& image : scene.images) {
        Camera camera = cameras.at(image.camera_id);
        image.camera_id = camera.camera_id = 100 + image.image_id;
        scene.cameras[camera.camera_id] = camera;
      }
    }
    for (auto& [id, camera] : scene.cameras) {
      true_focals_[id] = camera.MeanFocal();
      camera.params.back() = 0.0;
      camera.has_prior_focal_length = lens.has_prior;
      if (lens.wrong_camera == kInvalidCameraId || lens.wrong_camera == id) {
        camera.SetMeanFocal(lens.focal_factor * camera.MeanFocal());
      }
    }
    const std::string path = folder_ / name;
    Database database(path);
    WriteScene(scene, SceneContent::kMatches, database);
    return path;
  }

  static std::map<TwoViewConfig, int> Configs(const std::string& path) {
    const Database database(path);
    std::map<TwoViewConfig, int> configs;
    for (const image_pair_t pair : database.ReadTwoViewGeometryPairIds()) {
      ++configs[database.ReadTwoViewGeometry(pair)->config];
    }
    return configs;
  }

  void ExpectOneFocalLength(const std::string& path) const {
    const std::map<camera_t, CameraLens> lenses = Database(path).ReadCameraLenses();
    ASSERT_EQ(lenses.size(), 9u);
    for (const auto& [id, lens] : lenses) {
      EXPECT_TRUE(lens.is_focal_known) << id;
      EXPECT_EQ(lens.focal_px, lenses.begin()->second.focal_px) << id;
      EXPECT_NEAR(lens.focal_px / true_focals_.at(id), 1.0, 0.02) << id;
    }
  }

  static int NumInliers(const std::string& path) {
    int sum = 0;
    for (const auto& [pair, num] : Database(path).ReadNumInliers()) sum += num;
    return sum;
  }

  // What was learned, at the guessed focal lengths (`focal_factor` of the true ones), by these.
  std::map<double, std::vector<double>> DistortionsByKind(const std::string& path,
                                                          double focal_factor) const {
    std::map<double, std::vector<double>> distortions;
    for (const auto& [id, lens] : Database(path).ReadCameraLenses()) {
      const double guess_px = focal_factor * true_focals_.at(id);
      const double focal_px = lens.focal_px > 0 ? lens.focal_px : guess_px;
      distortions[guess_px].push_back(lens.k * std::pow(guess_px / focal_px, 2));
    }
    return distortions;
  }

  mutable std::map<camera_t, double> true_focals_;
};

TEST_F(LensLearningTest, RightFocalLengthsAreNotGivenUpForDistortion) {
  const std::string straight = MakeDatabase("0.db", {});
  Verify(straight);
  for (const double k : {-0.3, -0.1, -0.05, 0.05, 0.1}) {
    const std::string path = MakeDatabase(std::to_string(k) + ".db", {.k = k});
    const StageReport report = Verify(path);
    EXPECT_EQ(report.Value("rejected_focals"), 0) << k;
    const Database database(path);
    // The scene fills the middle of the images, where 0.05 moves points by little more than noise.
    EXPECT_GE(report.Value("learned_lenses"), std::abs(k) < 0.1 ? 1 : 2) << k;
    int num_bent = 0;
    for (const auto& [id, lens] : database.ReadCameraLenses()) {
      EXPECT_EQ(lens.focal_px, 0);  // EXIF's holds
      if (lens.k == 0) continue;
      EXPECT_NEAR(lens.k, k, std::max(0.025, 0.15 * std::abs(k)));
      ++num_bent;
    }
    EXPECT_GE(num_bent, 1) << k;
    EXPECT_GT(NumInliers(path), 0.95 * NumInliers(straight)) << k;
    EXPECT_EQ(Configs(path)[TwoViewConfig::kUncalibrated], 0) << k;
    // What the database was given stays.
    for (const Camera& camera : database.ReadCameras()) EXPECT_EQ(camera.params.back(), 0.0);
  }
}

// A frame printed around every photograph.
TEST_F(LensLearningTest, WhatStaysStillTellsNothing) {
  const std::string path = MakeDatabase("framed.db", {.k = -0.1});
  {
    Database database(path);
    constexpr int kNumInFrame = 80;
    Rng rng(3);
    std::map<image_t, point2D_t> first;
    std::map<image_t, camera_t> camera_of;
    for (const Image& image : database.ReadImages()) {
      const Camera camera = database.ReadCameras()[image.camera_id - 1];
      camera_of[image.image_id] = image.camera_id;
      std::vector<Keypoint> keypoints = *database.ReadKeypoints(image.image_id);
      first[image.image_id] = static_cast<point2D_t>(keypoints.size());
      for (int i = 0; i < kNumInFrame; ++i) {
        const double along = (i / 4 + 0.5) / (kNumInFrame / 4);
        const double x = i % 4 < 2 ? along : (i % 4 - 2) * 0.98 + 0.01;
        const double y = i % 4 < 2 ? (i % 4) * 0.98 + 0.01 : along;
        keypoints.push_back({static_cast<float>(x * camera.width + 0.2 * rng.Gaussian()),
                             static_cast<float>(y * camera.height + 0.2 * rng.Gaussian())});
      }
      database.WriteKeypoints(image.image_id, keypoints);
    }
    for (const image_pair_t pair : database.ReadMatchedPairIds()) {
      const auto [id1, id2] = PairIdToImagePair(pair);
      if (camera_of.at(id1) != camera_of.at(id2)) continue;  // of another size
      FeatureMatches matches = *database.ReadMatches(pair);
      for (point2D_t i = 0; i < kNumInFrame; ++i) {
        matches.push_back({first.at(id1) + i, first.at(id2) + i});
      }
      database.WriteMatches(pair, matches);
    }
  }
  Verify(path);
  int num_bent = 0;
  for (const auto& [id, lens] : Database(path).ReadCameraLenses()) {
    if (lens.k == 0) continue;
    EXPECT_NEAR(lens.k, -0.1, 0.025) << id;
    ++num_bent;
  }
  EXPECT_EQ(num_bent, 2);
}

TEST_F(LensLearningTest, WrongFocalLengthsOfDistortedLensesAreRejected) {
  for (const double k : {-0.1, 0.05}) {
    for (const double factor : {0.5, 2.0}) {
      const std::string path =
          MakeDatabase(std::to_string(k) + std::to_string(factor) + ".db",
                       {.k = k, .focal_factor = factor, .wrong_camera = 104, .own_cameras = true});
      EXPECT_EQ(Verify(path).Value("rejected_focals"), 1) << k << " " << factor;
      EXPECT_TRUE(Database(path).ReadCameraFocals().at(104).is_rejected);
    }
  }
}

TEST_F(LensLearningTest, GuessedFocalLengthsAreLearned) {
  for (const double k : {0.0, -0.1}) {
    const std::string path =
        MakeDatabase(std::to_string(k) + ".db", {.k = k, .focal_factor = 1.3, .has_prior = false});
    Verify(path);
    const Database database(path);
    ASSERT_EQ(database.ReadCameraLenses().size(), true_focals_.size());
    for (const auto& [id, lens] : database.ReadCameraLenses()) {
      EXPECT_NEAR(lens.focal_px / true_focals_.at(id), 1.0, 0.04);
      EXPECT_LT(std::abs(std::log(lens.focal_px / true_focals_.at(id))), 4 * lens.focal_sigma);
      EXPECT_NEAR(lens.k, k, 4 * lens.k_sigma);
      EXPECT_TRUE(lens.is_focal_known);
    }
    EXPECT_LE(Configs(path)[TwoViewConfig::kUncalibrated], 1);  // by chance, of some fifty
    const std::map<camera_t, KnownIntrinsics> known = ReadKnownIntrinsics(database);
    for (const auto& [id, of] : known) EXPECT_FALSE(of.camera.has_prior_focal_length);
    const auto& [first_id, first] = *known.begin();
    EXPECT_NEAR(first.camera.MeanFocal() / true_focals_.at(first_id), 1.0, 0.04);
  }
}

// What a camera's pairs did not tell the last time is still a guess, for its pairs with others,
// too.
TEST_F(LensLearningTest, GuessesThatWereKeptAreNotTrusted) {
  const std::string path =
      MakeDatabase("a.db", {.focal_factor = 1.3, .has_prior = false, .own_cameras = true});
  Verify(path);
  Database database(path);
  const std::vector<image_pair_t> likely = database.ReadMatchedPairIds();
  for (const Image& image : database.ReadImages()) {
    const auto num_pairs = std::ranges::count_if(likely, [&](image_pair_t pair) {
      const auto [id1, id2] = PairIdToImagePair(pair);
      return id1 == image.image_id || id2 == image.image_id;
    });
    const bool is_kept = image.image_id != 1;
    database.WriteCameraLens(image.camera_id, {.num_pairs = is_kept ? int(num_pairs) : 0});
  }
  LearnLenses(database, likely);
  for (const auto& [id, lens] : database.ReadCameraLenses()) {
    EXPECT_TRUE(id == 101 || lens.IsEmpty());
    const double factor = lens.focal_px > 0 ? lens.focal_px / true_focals_.at(id) : 1.0;
    EXPECT_NEAR(factor, 1.0, 0.1) << id;
  }
}

// Photographs with a camera each, all of one lens, which the few pairs of one photograph do not
// tell.
TEST_F(LensLearningTest, CamerasOfOneKindShareTheirDistortion) {
  const std::string path = MakeDatabase(
      "one.db",
      {.k = -0.2, .focal_factor = 1.3, .has_prior = false, .own_cameras = true, .num_kinds = 1});
  Verify(path);
  const auto distortions = DistortionsByKind(path, 1.3);
  ASSERT_EQ(distortions.size(), 1u);
  ASSERT_EQ(distortions.begin()->second.size(), 9u);
  for (const double k : distortions.begin()->second) {
    EXPECT_NEAR(k, distortions.begin()->second.front(), 1e-9);
    EXPECT_NEAR(k, 1.3 * 1.3 * -0.2, 0.1);
  }
}

TEST_F(LensLearningTest, CamerasOfOneKindShareTheirFocalLength) {
  const std::string path = MakeDatabase("one.db", kOneKindAround);
  Verify(path);
  ExpectOneFocalLength(path);
}

// The center of a photograph on its side is elsewhere.
TEST_F(LensLearningTest, UprightCamerasAndThoseOnTheirSideShareTheirFocalLength) {
  const std::string path = MakeDatabase("one.db", kOneKindAround);
  {
    Database database(path);
    for (const Image& image : database.ReadImages()) {
      if (image.image_id % 3 != 0) continue;
      const Camera camera = database.ReadCameras()[image.image_id - 1];
      database.WriteCamera(Camera::FromFocal(camera.camera_id, camera.model, camera.MeanFocal(),
                                             camera.height, camera.width));
      std::vector<Keypoint> keypoints = *database.ReadKeypoints(image.image_id);
      for (Keypoint& k : keypoints) {
        k = {k.y, static_cast<float>(camera.width) - k.x, k.a21, k.a22, -k.a11, -k.a12};
      }
      database.WriteKeypoints(image.image_id, keypoints);
    }
  }
  Verify(path);
  ExpectOneFocalLength(path);
}

// Photographs that join later begin with the lens that the others have learned.
TEST_F(LensLearningTest, LaterCamerasOfTheKindHaveItsLens) {
  const std::string path = MakeDatabase(
      "one.db",
      {.k = -0.2, .focal_factor = 1.3, .has_prior = false, .own_cameras = true, .num_kinds = 1});
  Verify(path);
  Database database(path);
  const std::map<camera_t, CameraLens> before = database.ReadCameraLenses();
  Camera camera = database.ReadCameras().front();
  for (const auto& [id, factor] : {std::pair(201, 1.0), std::pair(202, 1.1)}) {
    camera.camera_id = id;
    camera.SetMeanFocal(factor * camera.MeanFocal());
    database.WriteCamera(camera);
    database.WriteImage(
        {camera.camera_id, "later" + std::to_string(id) + ".jpg", camera.camera_id});
  }
  AdoptLenses(database);
  std::map<camera_t, CameraLens> after = database.ReadCameraLenses();
  EXPECT_EQ(after.count(202), 0u);  // of another kind
  ASSERT_EQ(after.count(201), 1u);
  const CameraLens later = after.at(201);
  after.erase(201);
  EXPECT_EQ(after, before);
  EXPECT_EQ(later.k, before.begin()->second.k);
  EXPECT_NE(later.k, 0);

  // Where focal lengths were learned, too, the median one.
  double focal_px = 1000;
  for (auto [id, lens] : before) {
    lens.focal_px = focal_px += 10;
    database.WriteCameraLens(id, lens);
  }
  Camera another = database.ReadCameras().front();
  another.camera_id = 203;
  database.WriteCamera(another);
  database.WriteImage({203, "last.jpg", 203});
  AdoptLenses(database);
  EXPECT_EQ(database.ReadCameraLenses().at(203).focal_px, 1050);  // of ten: 201 has none
  EXPECT_FALSE(database.ReadCameraLenses().at(203).is_focal_known);

  another = Camera::FromFocal(205, another.model, another.MeanFocal(), another.height,
                              another.width);  // turned by a quarter
  database.WriteCamera(another);
  database.WriteImage({205, "turned.jpg", 205});
  AdoptLenses(database);
  EXPECT_EQ(database.ReadCameraLenses().at(205).k, later.k);

  another.camera_id = 204;
  another.params.back() = -0.3;  // measured
  database.WriteCamera(another);
  database.WriteImage({204, "measured.jpg", 204});
  AdoptLenses(database);
  EXPECT_EQ(database.ReadCameraLenses().count(204), 0u);
}

// Those that are not alike are told apart: the kind that most images have shares its distortion,
// the photographs of the other one keep what their own pairs say.
TEST_F(LensLearningTest, CamerasOfTheRarerKindHaveLensesOfTheirOwn) {
  const std::string path = MakeDatabase(
      "two.db", {.k = -0.2, .focal_factor = 1.3, .has_prior = false, .own_cameras = true});
  Verify(path);
  const auto distortions = DistortionsByKind(path, 1.3);
  ASSERT_EQ(distortions.size(), 2u);
  for (const auto& [focal_px, of_kind] : distortions) {
    const auto [least, most] = std::ranges::minmax(of_kind);
    EXPECT_EQ(most - least<1e-9, 2 * of_kind.size()> 9) << focal_px;
  }
}

TEST_F(LensLearningTest, GivenAndMeasuredCamerasAreLeftAlone) {
  const std::string given = MakeDatabase("given.db", {.k = -0.1});
  Database(given).WriteStage({"cameras", "camera_params = [1000, 500, 400, 0]\n", true});
  EXPECT_EQ(Verify(given).Value("learned_lenses"), 0);
  EXPECT_TRUE(Database(given).ReadCameraLenses().empty());

  const std::string measured = MakeDatabase("measured.db", {.k = -0.1});
  {
    Database database(measured);
    for (Camera camera : database.ReadCameras()) {
      camera.params[1] += 3.0;  // the principal point
      database.WriteCamera(camera);
    }
  }
  EXPECT_EQ(Verify(measured).Value("learned_lenses"), 0);
}

// Pixels of wide lenses have no fundamental matrix; those between other cameras still teach.
TEST_F(LensLearningTest, PairsWithAWideCameraTeachNothing) {
  const std::string path =
      MakeDatabase("mixed.db", {.focal_factor = 1.3, .has_prior = false, .num_kinds = 3});
  Database database(path);
  Camera camera = database.ReadCameras().back();
  camera = Camera::FromFocal(camera.camera_id, CameraModel::kOpenCVFisheye, camera.MeanFocal(),
                             camera.width, camera.height);
  camera.has_prior_focal_length = true;
  database.WriteCamera(camera);
  Verify(path);
  const std::map<camera_t, CameraLens> lenses = database.ReadCameraLenses();
  EXPECT_EQ(lenses.count(camera.camera_id), 0u);
  EXPECT_EQ(lenses.size(), 2u);
}

// A plane's fundamental matrix, found at a guess, agrees with that.
TEST_F(LensLearningTest, PlanesAndRotationsTellNoFocalLength) {
  const std::string path = MakeDatabase("a.db", {.focal_factor = 1.3, .has_prior = false});
  Verify(path);
  Database database(path);
  const std::vector<image_pair_t> likely = database.ReadMatchedPairIds();
  const auto num_learned_with = [&](TwoViewConfig config) {
    for (const image_pair_t pair : database.ReadTwoViewGeometryPairIds()) {
      TwoViewGeometry geometry = *database.ReadTwoViewGeometry(pair);
      geometry.config = config;
      database.WriteTwoViewGeometry(pair, geometry);
    }
    for (const camera_t id : {1, 2}) database.WriteCameraLens(id, {});
    LearnLenses(database, likely);
    return std::ranges::count_if(database.ReadCameraLenses(),
                                 [](const auto& entry) { return entry.second.focal_px > 0; });
  };
  EXPECT_EQ(num_learned_with(TwoViewConfig::kPlanar), 0);
  EXPECT_EQ(num_learned_with(TwoViewConfig::kCalibrated), 2);
}

TEST_F(LensLearningTest, WhatIsCompleteStaysAsItIs) {
  const std::string path = MakeDatabase("a.db", {.k = -0.1});
  Verify(path);
  const std::string dump = DumpDatabase(path);
  EXPECT_NE(dump.find("\ncairn_camera_lenses: 1 "), std::string::npos);
  // As another version left it.
  const std::string old = MakeDatabase("old.db", {.k = -0.1});
  Verify(old);
  Database(old).WriteCameraLens(1, {});
  Database(old).WriteCameraLens(2, {});
  const std::string before = DumpDatabase(old);
  EXPECT_EQ(Verify(old).Value("learned_lenses"), 0);
  EXPECT_TRUE(DumpDatabase(old) == before);
  EXPECT_EQ(Verify(path).Value("learned_lenses"), 0);
  EXPECT_TRUE(DumpDatabase(path) == dump);
}

TEST_F(LensLearningTest, RowsDoNotDependOnThreadsOrInterruptions) {
  for (const bool has_prior : {true, false}) {
    const LensCase lens = {.k = -0.1,
                           .focal_factor = has_prior ? 0.5 : 1.3,
                           .has_prior = has_prior,
                           .wrong_camera = has_prior ? 2 : kInvalidCameraId};
    const std::string name = has_prior ? "exif" : "guess";
    ExpectEqualRows([&](const std::string& part) { return MakeDatabase(name + part, lens); },
                    "learned_lenses", 2);
  }
}

}  // namespace
}  // namespace cairn
