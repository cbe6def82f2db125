#include "cairn/database/database.h"

#include <regex>

#include "support/database_dump.h"
#include "support/test.h"
#include "unit/database/database_fixture.h"

namespace cairn {
namespace {

void ExpectEqual(const TwoViewGeometry& a, const TwoViewGeometry& b) {
  EXPECT_EQ(a.config, b.config);
  EXPECT_EQ(a.E, b.E);
  EXPECT_EQ(a.F, b.F);
  EXPECT_EQ(a.H, b.H);
  EXPECT_EQ(a.inlier_matches, b.inlier_matches);
  ASSERT_EQ(a.cam2_from_cam1.has_value(), b.cam2_from_cam1.has_value());
  if (!a.cam2_from_cam1) return;
  EXPECT_EQ(a.cam2_from_cam1->rotation.coeffs(), b.cam2_from_cam1->rotation.coeffs());
  EXPECT_EQ(a.cam2_from_cam1->translation, b.cam2_from_cam1->translation);
}

TEST_F(DatabaseTest, CamerasAndImagesRoundTripInOrderOfIds) {
  Database database(":memory:");
  database.WriteCamera(TestCamera(7));
  Camera pinhole = Camera::FromFocal(3, CameraModel::kPinhole, 800, 640, 480);
  database.WriteCamera(pinhole);
  database.WriteImage({5, "b/ä.jpg", 7});
  database.WriteImage({2, "a.jpg", 3});
  const std::vector<Camera> cameras = database.ReadCameras();
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_EQ(cameras[0].camera_id, 3u);
  EXPECT_EQ(cameras[0].model, CameraModel::kPinhole);
  EXPECT_FALSE(cameras[0].has_prior_focal_length);
  EXPECT_EQ(cameras[1].params, TestCamera().params);
  EXPECT_TRUE(cameras[1].has_prior_focal_length);
  EXPECT_EQ(cameras[1].width, 1536);
  EXPECT_EQ(cameras[1].height, 1024);
  const std::vector<Image> images = database.ReadImages();
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[0].name, "a.jpg");
  EXPECT_EQ(images[1].name, "b/ä.jpg");
  EXPECT_EQ(images[1].camera_id, 7u);
}

TEST_F(DatabaseTest, WritingAgainReplaces) {
  Database database(":memory:");
  WriteImages(database, 1);
  database.WriteKeypoints(1, RandomKeypoints(3, 1));
  Camera camera = TestCamera();
  camera.params[0] = 99;
  database.WriteCamera(camera);  // Keeps the rows that refer to it.
  database.WriteImage({1, "renamed.jpg", 1});
  EXPECT_EQ(database.ReadCameras()[0].params[0], 99);
  EXPECT_EQ(database.ReadImages()[0].name, "renamed.jpg");
  EXPECT_EQ(database.ReadKeypoints(1)->size(), 3u);
  database.WriteKeypoints(1, RandomKeypoints(4, 2));
  EXPECT_EQ(*database.ReadKeypoints(1), RandomKeypoints(4, 2));
}

TEST_F(DatabaseTest, FeaturesRoundTrip) {
  Database database(":memory:");
  WriteImages(database, 3);
  EXPECT_FALSE(database.ReadKeypoints(1));
  EXPECT_FALSE(database.ReadDescriptors(1));
  EXPECT_FALSE(database.ReadDepthSamples(1));
  const std::vector<Keypoint> keypoints = RandomKeypoints(50, 1);
  Descriptors descriptors = Descriptors::Random(50, 128);
  std::vector<DepthSample> depth(50);
  depth[3] = {2.5f, 0.1f, -0.2f, true};
  database.WriteKeypoints(1, keypoints);
  database.WriteDescriptors(1, descriptors);
  database.WriteDepthSamples(1, depth);
  EXPECT_EQ(*database.ReadKeypoints(1), keypoints);
  EXPECT_EQ(*database.ReadDescriptors(1), descriptors);
  const std::vector<DepthSample> read = *database.ReadDepthSamples(1);
  ASSERT_EQ(read.size(), 50u);
  EXPECT_TRUE(read[3].is_valid);
  EXPECT_EQ(read[3].depth, 2.5f);
  EXPECT_EQ(read[3].ddepth_dx, 0.1f);
  EXPECT_EQ(read[3].ddepth_dy, -0.2f);
  EXPECT_FALSE(read[4].is_valid);
  database.WriteKeypoints(2, {});  // An image without texture: a row, and nothing in it.
  database.WriteDescriptors(2, Descriptors(0, 128));
  EXPECT_TRUE(database.ReadKeypoints(2)->empty());
  EXPECT_EQ(database.ReadDescriptors(2)->rows(), 0);
  EXPECT_EQ(database.ReadNumKeypoints(), (std::map<image_t, int>{{1, 50}, {2, 0}}));
  EXPECT_EQ(database.ReadNumKeypoints(1), 50);
  EXPECT_EQ(database.ReadNumKeypoints(3), std::nullopt);
  EXPECT_EQ(database.ReadNumDescriptors(), (std::map<image_t, int>{{1, 50}, {2, 0}}));
  EXPECT_EQ(database.ReadNumDepthSamples(), (std::map<image_t, int>{{1, 50}}));
}

TEST_F(DatabaseTest, PolaritiesBelongToTheDescriptorsThatTheyWereWrittenWith) {
  Database database(":memory:");
  WriteImages(database, 2);
  const Descriptors descriptors = Descriptors::Random(3, 128), others = Descriptors::Random(3, 128);
  const Polarities polarities = {1, 0, 1};
  EXPECT_THAT(database.ReadPolarities(1, descriptors), IsEmpty());
  database.WriteDescriptors(1, descriptors, polarities);
  EXPECT_EQ(database.ReadPolarities(1, descriptors), polarities);
  EXPECT_THAT(database.ReadPolarities(1, others), IsEmpty());
  EXPECT_THAT(database.ReadPolarities(2, descriptors), IsEmpty());
  database.WriteDescriptors(1, descriptors);
  EXPECT_THAT(database.ReadPolarities(1, descriptors), IsEmpty());
  EXPECT_THROW(database.WriteDescriptors(1, descriptors, {1, 0}), BugError);
  database.WriteDescriptors(1, descriptors, polarities);
  database.ClearStage("features");
  EXPECT_THAT(database.ReadPolarities(1, descriptors), IsEmpty());
}

TEST_F(DatabaseTest, DepthSamplesReplaceOthersAndTheirHashFollows) {
  Database database(":memory:");
  WriteImages(database, 2);
  EXPECT_FALSE(database.ReadDepthHash(1));
  std::vector<DepthSample> samples(5);
  samples[0] = {1.5f, 0.1f, -0.2f, true};
  database.WriteDepthSamples(1, samples);
  EXPECT_TRUE((*database.ReadDepthSamples(1))[0].is_valid);
  EXPECT_FALSE((*database.ReadDepthSamples(1))[1].is_valid);
  const uint64_t hash = *database.ReadDepthHash(1);
  database.WriteDepthSamples(1, samples);
  EXPECT_EQ(database.ReadDepthHash(1), hash);
  samples[0].ddepth_dy = -0.3f;
  database.WriteDepthSamples(1, samples);
  EXPECT_NE(database.ReadDepthHash(1), hash);
  EXPECT_EQ((*database.ReadDepthSamples(1))[0].ddepth_dy, -0.3f);
  EXPECT_EQ(database.ReadNumDepthSamples(), (std::map<image_t, int>{{1, 5}}));
}

TEST_F(DatabaseTest, LearnedFocalsRoundTrip) {
  Database database(":memory:");
  WriteImages(database, 2);
  const image_pair_t pair = ImagePairToPairId(1, 2);
  EXPECT_TRUE(database.ReadFocalEvidence().empty());
  EXPECT_TRUE(database.ReadCameraFocals().empty());
  EXPECT_TRUE(database.ReadCameraLenses().empty());
  const CameraLens lens = {1375.5, 0.01, true, -0.05, 0.002, 17};
  const auto fill = [&] {
    database.WriteTwoViewGeometry(pair, TestGeometry());
    database.WriteFocalEvidence({pair, 100, 60, 90});
    database.WriteJob("verification", {pair, 1, ""});
    database.WriteCameraFocals({{database.ReadCameras()[0].camera_id, {true, 5, 4}}});
    database.WriteCameraLens(database.ReadCameras()[0].camera_id, lens);
  };
  fill();
  const PairFocalEvidence evidence = database.ReadFocalEvidence().at(0);
  EXPECT_EQ(evidence.pair_id, pair);
  EXPECT_EQ(evidence.num_matches, 100);
  EXPECT_EQ(evidence.num_by_essential, 60);
  EXPECT_EQ(evidence.num_by_fundamental, 90);
  const CameraFocal focal = database.ReadCameraFocals().begin()->second;
  EXPECT_TRUE(focal.is_rejected);
  EXPECT_EQ(focal.num_pairs, 5);
  EXPECT_EQ(focal.num_contradicting, 4);
  EXPECT_EQ(database.ReadCameraLenses().begin()->second, lens);

  database.DeletePairResults(pair);
  EXPECT_FALSE(database.ReadTwoViewGeometry(pair));
  EXPECT_EQ(database.ReadFocalEvidence().size(), 1u);
  database.DeleteFocalEvidence(pair);
  EXPECT_TRUE(database.ReadFocalEvidence().empty());
  EXPECT_EQ(database.ReadJobs("verification").size(), 1u);
  database.DeleteJob("verification", pair);
  EXPECT_TRUE(database.ReadJobs("verification").empty());
  EXPECT_EQ(database.ReadCameraFocals().size(), 1u);
  database.WriteCameraFocals({});
  EXPECT_TRUE(database.ReadCameraFocals().empty());
  fill();
  database.ClearStage("verification");
  EXPECT_TRUE(database.ReadFocalEvidence().empty());
  EXPECT_TRUE(database.ReadCameraFocals().empty());
  EXPECT_TRUE(database.ReadCameraLenses().empty());
}

TEST_F(DatabaseTest, KeypointsWithTwoOrFourColumnsBecomeFrames) {
  {
    Database database(Path());
    WriteImages(database, 2);
  }
  RunSql(Path(),  // (10.5, 20.25), and with scale 3 and a quarter turn (1, 2, 3, pi / 2)
         "INSERT INTO keypoints VALUES(1, 1, 2, X'000028410000A241'),"
         "(2, 1, 4, X'0000803F0000004000004040DB0FC93F')");
  const Database database(Path(), Database::Mode::kReadOnly);
  EXPECT_EQ((*database.ReadKeypoints(1))[0], (Keypoint{10.5f, 20.25f, 1, 0, 0, 1}));
  const Keypoint k = (*database.ReadKeypoints(2))[0];
  EXPECT_NEAR(k.a11, 0, 1e-6);
  EXPECT_NEAR(k.a12, -3, 1e-6);
  EXPECT_NEAR(k.a21, 3, 1e-6);
  EXPECT_NEAR(k.a22, 0, 1e-6);
}

TEST_F(DatabaseTest, PairsRoundTripToTheBit) {
  Database database(":memory:");
  WriteImages(database, 9);
  const image_pair_t pair = ImagePairToPairId(3, 2);
  const FeatureMatches matches = {{0, 1}, {7, 4000000000u}};
  database.WriteMatches(pair, matches);
  database.WriteMatches(ImagePairToPairId(1, 9), {});
  database.WriteTwoViewGeometry(pair, TestGeometry());
  database.WriteTwoViewGeometry(ImagePairToPairId(1, 9), {});
  EXPECT_EQ(*database.ReadMatches(pair), matches);
  EXPECT_FALSE(database.ReadMatches(ImagePairToPairId(1, 2)));
  EXPECT_TRUE(database.ReadMatches(ImagePairToPairId(1, 9))->empty());
  ExpectEqual(*database.ReadTwoViewGeometry(pair), TestGeometry());
  ExpectEqual(*database.ReadTwoViewGeometry(ImagePairToPairId(1, 9)), {});
  EXPECT_EQ(database.ReadMatchedPairIds(), std::vector<image_pair_t>{pair});
  EXPECT_EQ(database.ReadTwoViewGeometryPairIds(), std::vector<image_pair_t>{pair});
  EXPECT_EQ(database.ReadNumMatches(),
            (std::vector<std::pair<image_pair_t, int>>{{ImagePairToPairId(1, 9), 0}, {pair, 2}}));
  EXPECT_EQ(database.ReadNumInliers().back().second, 3);
}

TEST_F(DatabaseTest, MatricesAreStoredRowMajorAndPosesAsWxyz) {
  {
    Database database(Path());
    database.WriteTwoViewGeometry(ImagePairToPairId(1, 2), TestGeometry());
  }
  const auto rows = RunSql(Path(), "SELECT config, E, H, qvec, tvec FROM two_view_geometries");
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0][0], "2");
  EXPECT_EQ(rows[0][1].substr(0, 2 + 32), "X'000000000000F03F0000000000000040");  // 1.0, 2.0
  EXPECT_EQ(rows[0][2], "NULL");
  EXPECT_EQ(rows[0][3].size(), 3 + 2 * 32u);
  const double w = Eigen::Quaterniond(0.9, 0.1, -0.2, 0.3).normalized().w();
  char hex[17];
  for (int i = 0; i < 8; ++i) {
    std::snprintf(hex + 2 * i, 3, "%02X", reinterpret_cast<const unsigned char*>(&w)[i]);
  }
  EXPECT_EQ(rows[0][3].substr(2, 16), hex);
}

TEST_F(DatabaseTest, ColmapsStandInsForAnUnknownPoseAreNoPose) {
  Database database(":memory:");
  TwoViewGeometry geometry = TestGeometry();
  geometry.cam2_from_cam1 = Rigid3d();  // The identity, up to COLMAP 3.13.
  geometry.H = Eigen::Matrix3d::Zero();
  database.WriteTwoViewGeometry(ImagePairToPairId(1, 2), geometry);
  EXPECT_FALSE(database.ReadTwoViewGeometry(ImagePairToPairId(1, 2))->cam2_from_cam1);
  EXPECT_FALSE(database.ReadTwoViewGeometry(ImagePairToPairId(1, 2))->H);
  // A pure rotation is a pose.
  geometry.cam2_from_cam1 = Rigid3d(Eigen::Quaterniond(0.8, 0.6, 0, 0), Eigen::Vector3d::Zero());
  database.WriteTwoViewGeometry(ImagePairToPairId(1, 2), geometry);
  EXPECT_TRUE(database.ReadTwoViewGeometry(ImagePairToPairId(1, 2))->cam2_from_cam1);
}

TEST_F(DatabaseTest, CairnTablesRoundTrip) {
  Database database(":memory:");
  WriteImages(database, 2);
  PairMetrics metrics;
  metrics.pair_id = ImagePairToPairId(1, 2);
  metrics.verifier = "one_ac_depth";
  metrics.status = "verified";
  metrics.is_winner = true;
  metrics.step = "two_ac";
  metrics.num_matches = 100;
  metrics.num_inliers = 60;
  metrics.num_iterations = int64_t{1} << 40;
  metrics.score = 55.25;
  metrics.residual_px = 0.5;
  metrics.triangulation_angle_deg = 12;
  metrics.cam2_from_cam1 = TestGeometry().cam2_from_cam1;
  database.WritePairMetrics(metrics);
  metrics.verifier = "five_point";
  metrics.is_winner = false;
  metrics.cam2_from_cam1.reset();
  database.WritePairMetrics(metrics);
  const std::vector<PairMetrics> read = database.ReadPairMetrics();
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].verifier, "five_point");
  EXPECT_FALSE(read[0].cam2_from_cam1);
  EXPECT_EQ(read[1].verifier, "one_ac_depth");
  EXPECT_TRUE(read[1].is_winner);
  EXPECT_EQ(read[1].step, "two_ac");
  EXPECT_EQ(read[1].num_iterations, int64_t{1} << 40);
  EXPECT_EQ(read[1].score, 55.25);
  EXPECT_EQ(read[1].cam2_from_cam1->translation, TestGeometry().cam2_from_cam1->translation);

  database.WritePhoto({"b.jpg", ~uint64_t{0}, ""});
  database.WritePhoto({"a.jpg", 5, "is truncated"});
  const std::vector<PhotoRecord> photos = database.ReadPhotos();
  ASSERT_EQ(photos.size(), 2u);
  EXPECT_EQ(photos[0].error, "is truncated");
  EXPECT_EQ(photos[1].file_hash, ~uint64_t{0});

  database.WriteJob("matching", {7, ~uint64_t{0}, "given"});
  database.WriteJob("matching", {3, 1, ""});
  database.WriteJob("depth", {3, 2, ""});
  EXPECT_EQ(database.ReadJobs("matching").size(), 2u);
  EXPECT_EQ(database.ReadJobs("matching")[1].note, "given");
  ASSERT_EQ(database.ReadJobs("depth").size(), 1u);
  EXPECT_EQ(database.ReadJobs("depth")[0].input_hash, 2u);

  database.WriteStage({"depth", "a = 1\n", true});
  EXPECT_EQ(database.ReadStage("depth")->options, "a = 1\n");
  EXPECT_TRUE(database.ReadStage("depth")->is_complete);
  EXPECT_FALSE(database.ReadStage("matching"));

  database.WriteTiming("depth", 0, "", 1.5);
  database.AddStageTime("depth", 2.0);
  database.AddStageTime("matching", 2.0);
  EXPECT_EQ(database.ReadTiming("depth", 0, ""), 3.5);
  EXPECT_EQ(database.ReadTiming("matching", 0, ""), 2.0);
  database.ClearStage("depth");
  EXPECT_FALSE(database.ReadStage("depth"));
  EXPECT_TRUE(database.ReadJobs("depth").empty());
  EXPECT_FALSE(database.ReadTiming("depth", 0, ""));
  EXPECT_EQ(database.ReadJobs("matching").size(), 2u);
}

TEST_F(DatabaseTest, APairKeepsTheReasonThatItHadFirst) {
  Database database(":memory:");
  WriteImages(database, 3);
  const PairChoiceRecord first = {ImagePairToPairId(1, 3), 0, "spatial"};
  database.WritePairChoice(first);
  database.WritePairChoice({ImagePairToPairId(1, 2), 2, "two_edges"});
  database.WritePairChoice({ImagePairToPairId(1, 3), 1, "weak"});
  ASSERT_EQ(database.ReadPairChoices().size(), 2u);
  EXPECT_EQ(database.ReadPairChoices()[0].reason, "two_edges");
  EXPECT_EQ(database.ReadPairChoices()[1], first);
}

TEST_F(DatabaseTest, APairMayHaveInliersAlone) {
  Database database(":memory:");
  WriteImages(database, 3);
  const image_pair_t told = ImagePairToPairId(1, 2), untold = ImagePairToPairId(1, 3);
  database.WriteTwoViewGeometry(told, TestGeometry());
  EXPECT_TRUE(database.HasGeometry(told));
  TwoViewGeometry pose_alone = TestGeometry();
  for (auto* matrix : {&pose_alone.E, &pose_alone.F, &pose_alone.H}) *matrix = {};
  database.WriteTwoViewGeometry(told, pose_alone);
  EXPECT_TRUE(database.HasGeometry(told));
  TwoViewGeometry inliers_alone = pose_alone;
  inliers_alone.cam2_from_cam1 = {};
  inliers_alone.F = Eigen::Matrix3d::Zero();  // as COLMAP 3.8 writes what it does not have
  database.WriteTwoViewGeometry(untold, inliers_alone);
  EXPECT_FALSE(database.HasGeometry(untold));
  EXPECT_FALSE(database.HasGeometry(ImagePairToPairId(2, 3)));
}

TEST_F(DatabaseTest, OrderOfWritingDoesNotShowInTheDump) {
  const auto write = [&](const std::string& name, std::vector<int> order) {
    Database database(Path(name));
    WriteImages(database, 4);
    for (const int i : order) {
      database.WriteKeypoints(i, RandomKeypoints(5, i));
      database.WriteMatches(ImagePairToPairId(i, i + 1), {{0, 0}});
      PairMetrics metrics;
      metrics.pair_id = ImagePairToPairId(i, i + 1);
      for (const char* verifier : {i % 2 ? "a" : "b", i % 2 ? "b" : "a"}) {
        metrics.verifier = verifier;
        database.WritePairMetrics(metrics);
      }
      database.WriteJob("verification", {metrics.pair_id, 1, ""});
      database.WriteTiming("verification", metrics.pair_id, "a", order[0] * 0.1);
    }
    return Path(name);
  };
  const std::string dump = DumpDatabase(write("a.db", {1, 2, 3, 4}));
  EXPECT_EQ(dump, DumpDatabase(write("b.db", {4, 2, 1, 3})));
  EXPECT_THAT(dump, HasSubstr("cairn_pair_metrics:"));
}

TEST_F(DatabaseTest, ATransactionRollsBackUnlessCommitted) {
  Database database(Path());
  WriteImages(database, 1);
  try {
    Database::Transaction transaction(database);
    database.WriteMatches(ImagePairToPairId(1, 2), {{0, 0}});
    throw std::runtime_error("");
  } catch (const std::runtime_error&) {
  }
  EXPECT_FALSE(database.ReadMatches(ImagePairToPairId(1, 2)));
  {
    Database::Transaction transaction(database);
    database.WriteMatches(ImagePairToPairId(1, 2), {{0, 0}});
    transaction.Commit();
  }
  EXPECT_TRUE(database.ReadMatches(ImagePairToPairId(1, 2)));
}

// Table definitions with white space made equal.
std::string Normalized(std::string sql) {
  sql = std::regex_replace(sql, std::regex("\\s+"), " ");
  sql = std::regex_replace(sql, std::regex(" ?([(),]) ?"), "$1");
  return std::regex_replace(sql, std::regex("IF NOT EXISTS "), "");
}

// As `colmap database_creator` of Debian's 3.8-1 makes them, white space apart.
TEST_F(DatabaseTest, TheSchemaIsThatOfColmap38) {
  { Database database(Path()); }
  const std::vector<std::string> expected = {
      "CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,model INTEGER NOT "
      "NULL,width INTEGER NOT NULL,height INTEGER NOT NULL,params BLOB,prior_focal_length INTEGER "
      "NOT NULL)",
      "CREATE TABLE images(image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,name TEXT NOT NULL "
      "UNIQUE,camera_id INTEGER NOT NULL,prior_qw REAL,prior_qx REAL,prior_qy REAL,prior_qz "
      "REAL,prior_tx REAL,prior_ty REAL,prior_tz REAL,CONSTRAINT image_id_check CHECK(image_id >= "
      "0 and image_id < 2147483647),FOREIGN KEY(camera_id)REFERENCES cameras(camera_id))",
      "CREATE UNIQUE INDEX index_name ON images(name)",
      "CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY NOT NULL,rows INTEGER NOT NULL,cols "
      "INTEGER NOT NULL,data BLOB,FOREIGN KEY(image_id)REFERENCES images(image_id)ON DELETE "
      "CASCADE)",
      "CREATE TABLE descriptors(image_id INTEGER PRIMARY KEY NOT NULL,rows INTEGER NOT NULL,cols "
      "INTEGER NOT NULL,data BLOB,FOREIGN KEY(image_id)REFERENCES images(image_id)ON DELETE "
      "CASCADE)",
      "CREATE TABLE matches(pair_id INTEGER PRIMARY KEY NOT NULL,rows INTEGER NOT NULL,cols "
      "INTEGER NOT NULL,data BLOB)",
      "CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL,rows INTEGER NOT "
      "NULL,cols INTEGER NOT NULL,data BLOB,config INTEGER NOT NULL,F BLOB,E BLOB,H BLOB,qvec "
      "BLOB,tvec BLOB)"};
  std::vector<std::string> actual;
  for (const auto& row : RunSql(Path(),
                                "SELECT sql FROM sqlite_master WHERE sql NOT NULL AND name NOT "
                                "LIKE 'cairn%' AND name NOT LIKE 'sqlite%' ORDER BY rowid")) {
    actual.push_back(Normalized(row[0]));
  }
  EXPECT_EQ(actual, expected);
  EXPECT_EQ(RunSql(Path(), "PRAGMA user_version")[0][0], "3800");
  EXPECT_EQ(RunSql(Path(), "PRAGMA application_id")[0][0], "0");
  EXPECT_EQ(RunSql(Path(), "PRAGMA journal_mode")[0][0], "wal");
}

}  // namespace
}  // namespace cairn
