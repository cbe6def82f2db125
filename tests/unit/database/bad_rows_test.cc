// Rows that other programs, or damage, left behind; files of old versions of COLMAP.
#include <cmath>
#include <limits>
#include <map>

#include "cairn/base/file.h"
#include "support/database_dump.h"
#include "support/test.h"
#include "support/thrown_message.h"
#include "unit/database/database_fixture.h"

namespace cairn {
namespace {

class BadRowsTest : public DatabaseTest {
 protected:
  void SetUp() override {
    Database database(Path());
    WriteImages(database, 4);
    for (image_t id = 1; id <= 4; ++id) database.WriteKeypoints(id, RandomKeypoints(6, id));
    database.WriteMatches(ImagePairToPairId(1, 2), {{0, 0}});
    database.WriteMatches(ImagePairToPairId(2, 3), {{0, 0}});
    database.WriteTwoViewGeometry(ImagePairToPairId(1, 2), TestGeometry());
    database.WriteTwoViewGeometry(ImagePairToPairId(2, 3), TestGeometry());
    EXPECT_THAT(database.FindBadRows(), IsEmpty());
  }
  void Sql(const std::string& sql) { RunSql(Path(), sql); }  // without foreign keys
};

TEST_F(BadRowsTest, PairsThatAreNone) {
  for (const auto& [pair_id, reason] : std::map<std::string, std::string>{
           {"3 * 2147483647 + 3", "an image is paired with itself"},
           {"4 * 2147483647 + 1", "the larger image id is first"},
           {"1 * 2147483647 + 77", "there is no such image"},
           {"-5", "the id is negative"},
           {"-9223372036854775808", "the id is negative"},
           {"9223372036854775807", "the larger image id is first"}}) {
    for (const std::string table : {"matches", "two_view_geometries"}) {
      const std::string where =
          " WHERE pair_id NOT IN (SELECT MIN(pair_id) FROM matches WHERE pair_id > 0)";
      Sql("UPDATE " + table + " SET pair_id = " + pair_id + where);
    }
    const Database database(Path(), Database::Mode::kReadOnly);
    EXPECT_THAT(database.FindBadRows(),
                ElementsAre(AllOf(HasSubstr("matches of pair"), HasSubstr(reason)),
                            AllOf(HasSubstr("two_view_geometries of pair"), HasSubstr(reason))));
    EXPECT_THAT(database.ReadMatchedPairIds(), ElementsAre(ImagePairToPairId(1, 2)));
    EXPECT_THAT(database.ReadTwoViewGeometryPairIds(), ElementsAre(ImagePairToPairId(1, 2)));
    Sql("UPDATE matches SET pair_id = 2 * 2147483647 + 3 WHERE pair_id <> 2147483649");
    Sql("UPDATE two_view_geometries SET pair_id = 2 * 2147483647 + 3 WHERE pair_id <> 2147483649");
  }
}

TEST_F(BadRowsTest, ImagesThatNoModelCanHold) {
  Sql("UPDATE images SET name = '' WHERE image_id = 1");
  Sql("UPDATE images SET name = 'a' || char(10) WHERE image_id = 2");
  Sql("UPDATE images SET name = x'61006A' WHERE image_id = 3");
  const Database database(Path());
  ASSERT_EQ(database.ReadImages().size(), 1u);
  EXPECT_EQ(database.ReadImages()[0].image_id, 4u);
  EXPECT_EQ(database.ReadNumKeypoints().size(), 1u);
  EXPECT_THAT(database.ReadMatchedPairIds(), IsEmpty());
  const std::vector<std::string> bad = database.FindBadRows();
  EXPECT_EQ(bad.size(), 3 + 3 + 2 + 2u);  // images, keypoints, matches, geometries
  EXPECT_THAT(bad[0], HasSubstr("image 1: the name is empty"));
  EXPECT_THAT(bad[1], HasSubstr("image 2: the name has a line break"));
}

// (4294967297 is 1 in its lower half, PINHOLE's.)
TEST_F(BadRowsTest, ACameraModelThatIsNone) {
  Sql("UPDATE cameras SET model = 4294967297");
  const Database database(Path());
  EXPECT_THAT(database.ReadCameras(), IsEmpty());
  ASSERT_THAT(database.ReadUnknownCameras(), SizeIs(1));
  EXPECT_EQ(database.ReadUnknownCameras()[0].model_id, 4294967297);
}

TEST_F(BadRowsTest, ARowOfAnImageThatIsGone) {
  Sql("DELETE FROM images WHERE image_id = 3");
  const Database database(Path());
  EXPECT_THAT(database.FindBadRows(),
              ElementsAre(HasSubstr("keypoints of image 3: there is no such image"),
                          HasSubstr("matches of pair"), HasSubstr("two_view_geometries of pair")));
  EXPECT_EQ(database.ReadNumKeypoints().size(), 3u);
}

TEST_F(BadRowsTest, PairsOfAnImageThatIsGoneAreNotCounted) {
  Database database(Path());
  for (const image_pair_t pair : {ImagePairToPairId(1, 2), ImagePairToPairId(2, 3)}) {
    PairMetrics metrics;
    metrics.pair_id = pair;
    metrics.verifier = metrics.step = "a";
    metrics.is_winner = true;
    database.WritePairMetrics(metrics);
    database.WriteJob("verification", {pair, 0, "rejected"});
    database.WritePairChoice({pair, 1, "exhaustive"});
  }
  Sql("DELETE FROM images WHERE image_id = 3");
  EXPECT_EQ(database.CountWinners().at("a"), 1);
  EXPECT_EQ(database.ReadStepTimes().at(0).num_pairs, 1);
  EXPECT_EQ(database.CountRejections().at("rejected"), 1);
  EXPECT_EQ(database.ReadPairChoices().size(), 1u);
  Sql("DELETE FROM two_view_geometries");
  EXPECT_THAT(database.ReadPairsToVerify(), ElementsAre(ImagePairToPairId(1, 2)));
}

TEST_F(BadRowsTest, CamerasThatAreNotValid) {
  for (const std::string change :
       {"params = zeroblob(64)", "params = x'00'", "params = NULL", "width = 0", "height = -1",
        "width = 8589934592 + 640", "camera_id = -1", "camera_id = 4294967296"}) {
    Sql("INSERT INTO cameras SELECT 2, model, width, height, params, prior_focal_length "
        "FROM cameras WHERE camera_id = 1");
    Sql("UPDATE cameras SET " + change + " WHERE camera_id = 2");
    const Database database(Path());
    EXPECT_EQ(database.ReadCameras().size(), 1u) << change;
    EXPECT_EQ(database.FindBadRows().size(), 1u) << change;
    Sql("DELETE FROM cameras WHERE camera_id <> 1");
  }
}

TEST_F(BadRowsTest, DepthThatIsNoNumber) {
  Database database(Path());
  std::vector<DepthSample> samples(2, {1, 0, 0, true});
  for (const float value :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    samples[1].ddepth_dx = value;
    database.WriteDepthSamples(1, samples);
    EXPECT_THAT(ThrownMessage<IoError>([&] { database.ReadDepthSamples(1); }),
                HasSubstr("cairn_depth_scales of image 1: a value is not finite"));
  }
}

TEST_F(BadRowsTest, PosesThatAreNoNumbers) {
  const image_pair_t pair = ImagePairToPairId(1, 2);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double value : {nan, std::numeric_limits<double>::infinity(), 1e200}) {
    TwoViewGeometry geometry = TestGeometry();
    geometry.cam2_from_cam1->translation.x() = value;
    Database database(Path());
    database.WriteTwoViewGeometry(pair, geometry);
    EXPECT_THAT(ThrownMessage<IoError>([&] { database.ReadTwoViewGeometry(pair); }),
                HasSubstr("(images 1, 2): "));
    geometry = TestGeometry();
    (*geometry.F)(1, 2) = value;
    database.WriteTwoViewGeometry(pair, geometry);
    if (value == 1e200) continue;
    EXPECT_THAT(ThrownMessage<IoError>([&] { database.ReadTwoViewGeometry(pair); }),
                HasSubstr("F has a value that is not finite"));
  }
}

// COLMAP before 3.0 (inlier_matches), 3.4 (no F, E, H) and 3.6 (no qvec, tvec).
TEST_F(BadRowsTest, OldVersionsOfColmap) {
  const auto make_old = [&](const std::string& name, const std::string& changes) {
    fs::copy_file(Path(), Path(name), fs::copy_options::overwrite_existing);
    RunSql(Path(name),
           "DROP TRIGGER cairn_forget_learned; DROP INDEX cairn_images_of_cameras; "
           "DROP TABLE cairn_depth_scales; DROP TABLE cairn_pair_metrics; DROP TABLE "
           "cairn_focal_evidence; DROP TABLE cairn_camera_focals; DROP TABLE cairn_camera_lenses; "
           "DROP TABLE cairn_photos; DROP TABLE cairn_jobs; DROP TABLE cairn_stages; DROP TABLE "
           "cairn_timings;" +
               changes);
  };
  const std::string no_pose =
      "ALTER TABLE two_view_geometries DROP COLUMN qvec; "
      "ALTER TABLE two_view_geometries DROP COLUMN tvec;";
  const std::string no_matrix = no_pose +
                                "ALTER TABLE two_view_geometries DROP COLUMN F; "
                                "ALTER TABLE two_view_geometries DROP COLUMN E; "
                                "ALTER TABLE two_view_geometries DROP COLUMN H;";
  make_old("3.5.db", no_pose);
  make_old("3.3.db", no_matrix);
  make_old("2.db", no_matrix + "ALTER TABLE two_view_geometries RENAME TO inlier_matches;");
  for (const std::string name : {"3.5.db", "3.3.db", "2.db"}) {
    const std::string before = DumpDatabase(Path(name));
    for (const Database::Mode mode : {Database::Mode::kReadOnly, Database::Mode::kOpenExisting}) {
      Database database(Path(name), mode);
      const auto geometry = database.ReadTwoViewGeometry(ImagePairToPairId(1, 2));
      ASSERT_TRUE(geometry) << name;
      EXPECT_EQ(geometry->inlier_matches.size(), 3u);
      EXPECT_EQ(geometry->config, TwoViewConfig::kCalibrated);
      EXPECT_EQ(geometry->F.has_value(), name == "3.5.db");
      EXPECT_FALSE(geometry->cam2_from_cam1);
      if (mode == Database::Mode::kReadOnly) {
        EXPECT_EQ(DumpDatabase(Path(name)), before);
      } else {
        database.WriteTwoViewGeometry(ImagePairToPairId(1, 3), TestGeometry());
        EXPECT_TRUE(database.ReadTwoViewGeometry(ImagePairToPairId(1, 3))->cam2_from_cam1);
      }
    }
  }
}

// Nothing is written to a file that is refused.
TEST_F(BadRowsTest, ARefusedFileStaysAsItIs) {
  RunSql(Path("other.db"),
         "CREATE TABLE cameras(camera_id, model, width, height, params, prior_focal_length); "
         "CREATE TABLE images(image_id, name); CREATE TABLE keypoints(image_id); "
         "CREATE TABLE descriptors(image_id); CREATE TABLE matches(pair_id); "
         "CREATE TABLE two_view_geometries(pair_id)");
  const std::string before = ReadFile(Path("other.db"));
  EXPECT_THAT(ThrownMessage<IoError>([&] { Database database(Path("other.db")); }),
              HasSubstr("its table 'images' has no column 'camera_id'"));
  EXPECT_EQ(ReadFile(Path("other.db")), before);
}

}  // namespace
}  // namespace cairn
