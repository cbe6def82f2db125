// Files made by COLMAP are read and extended, ours are read by COLMAP.

#include <cstdlib>
#include <filesystem>

#include "cairn/database/database.h"
#include "support/database_dump.h"
#include "support/shared_data.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

class ColmapFilesTest : public ::testing::Test {
 protected:
  TempFolder temp_;
  const fs::path folder_ = temp_.path();
};

// COLMAP 4.2's tables that differ from 3.8's, shortened.
constexpr const char* kColmap42 = R"(
CREATE TABLE rigs(rig_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, ref_sensor_id INTEGER NOT NULL, ref_sensor_type INTEGER NOT NULL);
CREATE TABLE rig_sensors(rig_id INTEGER NOT NULL, sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL, sensor_from_rig BLOB, FOREIGN KEY(rig_id) REFERENCES rigs(rig_id) ON DELETE CASCADE);
CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);
CREATE TABLE frames(frame_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, rig_id INTEGER NOT NULL, FOREIGN KEY(rig_id) REFERENCES rigs(rig_id) ON DELETE CASCADE);
CREATE TABLE frame_data(frame_id INTEGER NOT NULL, data_id INTEGER NOT NULL, sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL, FOREIGN KEY(frame_id) REFERENCES frames(frame_id) ON DELETE CASCADE);
CREATE TABLE images(image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE, camera_id INTEGER NOT NULL, FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors(image_id INTEGER PRIMARY KEY NOT NULL, type INTEGER NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB, camera1 BLOB, camera2 BLOB);
CREATE UNIQUE INDEX rig_ref_sensor_assignment ON rigs(ref_sensor_id, ref_sensor_type);
CREATE UNIQUE INDEX frame_sensor_assignment ON frame_data(data_id, sensor_type);
PRAGMA user_version = 4020000;
)";

// Both cameras are of rig 1, and both images of its frame 1.
Database OneRigOfTwoCameras(const std::string& path) {
  RunSql(path, kColmap42);
  Database database(path);
  for (const image_t id : {1, 2}) {
    database.WriteCamera(Camera::FromFocal(id, CameraModel::kSimpleRadial, 20, 10, 10));
    database.WriteImage({id, "image" + std::to_string(id), id});
  }
  RunSql(path,
         "DELETE FROM rigs WHERE rig_id = 2; DELETE FROM frames WHERE frame_id = 2;"
         "INSERT INTO rig_sensors VALUES(1, 2, 0, X'');"
         "INSERT OR REPLACE INTO frame_data VALUES(1, 2, 2, 0)");
  return database;
}

TEST_F(ColmapFilesTest, AnImageThatGoesLeavesTheFrameToTheOthersInIt) {
  const std::string path = folder_ / "v4.db";
  Database database = OneRigOfTwoCameras(path);
  database.DeleteImage(2);
  EXPECT_EQ(RunSql(path, "SELECT * FROM frame_data"), (SqlRows{{"1", "1", "1", "0"}}));
  database.DeleteImage(1);
  EXPECT_EQ(RunSql(path, "SELECT * FROM frame_data"), SqlRows());
  EXPECT_EQ(RunSql(path, "SELECT * FROM frames"), SqlRows());
}

TEST_F(ColmapFilesTest, RigsThatAreNotUsedAreNamed) {
  const std::string path = folder_ / "v4.db";
  EXPECT_THAT(OneRigOfTwoCameras(path).FindBadRows(),
              ElementsAre(HasSubstr("rig_sensors of rig 1: ")));
  RunSql(path, "DELETE FROM rig_sensors");
  EXPECT_THAT(Database(path).FindBadRows(), IsEmpty());
}

TEST_F(ColmapFilesTest, AnImageThatGoesTakesItsPositionWithIt) {
  const std::string path = folder_ / "v4.db";
  Database database = OneRigOfTwoCameras(path);
  RunSql(path,
         "DROP TABLE IF EXISTS pose_priors; CREATE TABLE pose_priors(pose_prior_id INTEGER PRIMARY "
         "KEY, corr_data_id INTEGER, corr_sensor_id INTEGER, corr_sensor_type INTEGER);"
         "INSERT INTO pose_priors VALUES(1, 1, 1, 0), (2, 2, 2, 0), (3, 2, 2, 1)");
  database.DeleteImage(2);
  EXPECT_EQ(RunSql(path, "SELECT pose_prior_id FROM pose_priors"), (SqlRows{{"1"}, {"3"}}));
}

TEST_F(ColmapFilesTest, ARigStaysAsLongAsItHasAFrame) {
  const std::string path = folder_ / "v4.db";
  Database database = OneRigOfTwoCameras(path);
  database.DeleteImage(1);
  database.DeleteUnusedCameras();
  EXPECT_EQ(RunSql(path, "SELECT * FROM rigs"), (SqlRows{{"1", "1", "0"}}));
  EXPECT_EQ(RunSql(path, "SELECT sensor_id FROM rig_sensors"), (SqlRows{{"2"}}));
  EXPECT_EQ(RunSql(path, "SELECT * FROM frame_data"), (SqlRows{{"1", "2", "2", "0"}}));
  EXPECT_EQ(database.ReadCameras().size(), 2u);  // the rig has both
  database.DeleteImage(2);
  database.DeleteUnusedCameras();
  EXPECT_EQ(RunSql(path, "SELECT * FROM rigs"), SqlRows());
  EXPECT_THAT(database.ReadCameras(), IsEmpty());
}

TEST_F(ColmapFilesTest, ImagesJoinAColmap4FileWithRigsAndFrames) {
  const std::string path = folder_ / "v4.db";
  RunSql(path, kColmap42);
  RunSql(path,
         "INSERT INTO cameras VALUES(4, 0, 10, 10, X'000000000000F03F000000000000F03F"
         "000000000000F03F', 1);"
         "INSERT INTO rigs VALUES(9, 4, 0); INSERT INTO frames VALUES(6, 9);"
         "INSERT INTO images VALUES(2, 'old.jpg', 4);"
         "INSERT INTO frame_data VALUES(6, 2, 4, 0);"
         "CREATE TABLE pose_priors(pose_prior_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,"
         " corr_data_id INTEGER NOT NULL, corr_sensor_id INTEGER NOT NULL,"
         " corr_sensor_type INTEGER NOT NULL, position BLOB, position_covariance BLOB,"
         " gravity BLOB, coordinate_system INTEGER NOT NULL);"
         "INSERT INTO pose_priors VALUES(3, 2, 4, 0, X'01', X'02', X'03', 0);");
  {
    Database database(path);
    database.WriteCamera(Camera::FromFocal(5, CameraModel::kSimpleRadial, 20, 10, 10));
    database.WriteImage({3, "new.jpg", 5});
    database.WriteImage({4, "same_camera.jpg", 4});
    database.WriteImage({2, "old.jpg", 4});  // Keeps its frame.
    database.WriteDescriptors(3, Descriptors::Random(2, 128));
    EXPECT_EQ(database.ReadDescriptors(3)->rows(), 2);
    database.WriteTwoViewGeometry(ImagePairToPairId(2, 3), {});
    EXPECT_TRUE(database.ReadTwoViewGeometry(ImagePairToPairId(2, 3)));
  }
  EXPECT_EQ(RunSql(path, "SELECT * FROM rigs"), (SqlRows{{"9", "4", "0"}, {"10", "5", "0"}}));
  EXPECT_EQ(RunSql(path, "SELECT * FROM frames"), (SqlRows{{"6", "9"}, {"7", "10"}, {"8", "9"}}));
  EXPECT_EQ(RunSql(path, "SELECT * FROM frame_data ORDER BY frame_id"),
            (SqlRows{{"6", "2", "4", "0"}, {"7", "3", "5", "0"}, {"8", "4", "4", "0"}}));
  EXPECT_EQ(RunSql(path, "SELECT type FROM descriptors"), (SqlRows{{"0"}}));
  EXPECT_EQ(RunSql(path, "PRAGMA user_version"), (SqlRows{{"4020000"}}));
  {
    Database database(path);
    database.DeleteImage(3);
  }
  EXPECT_EQ(RunSql(path, "SELECT * FROM rigs"), (SqlRows{{"9", "4", "0"}}));
  EXPECT_EQ(RunSql(path, "SELECT * FROM frames"), (SqlRows{{"6", "9"}, {"8", "9"}}));
  EXPECT_EQ(RunSql(path, "SELECT frame_id FROM frame_data"), (SqlRows{{"6"}, {"8"}}));
  EXPECT_EQ(RunSql(path, "SELECT pose_prior_id, corr_data_id, hex(position) FROM pose_priors"),
            (SqlRows{{"3", "2", "01"}}));
}

// Debian's COLMAP 3.8 opens our file, reads our rows, and goes on from our matches.
TEST_F(ColmapFilesTest, Colmap38ReadsOurFile) {
  if (std::system("command -v colmap > /dev/null") != 0) GTEST_SKIP() << "colmap is not installed";
  const std::string path = folder_ / "ours.db";
  {
    Database database(path);
    database.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 800, 640, 480));
    std::vector<Keypoint> keypoints(30);
    for (int i = 0; i < 30; ++i) keypoints[i] = {10.0f * i, 5.0f * i};
    FeatureMatches matches;
    for (point2D_t i = 0; i < 30; ++i) matches.push_back({i, i});
    for (image_t id = 1; id <= 3; ++id) {
      database.WriteImage({id, "image" + std::to_string(id) + ".jpg", 1});
      database.WriteKeypoints(id, keypoints);
      database.WriteDescriptors(id, Descriptors::Constant(30, 128, 7));
    }
    TwoViewGeometry geometry;
    geometry.config = TwoViewConfig::kCalibrated;
    geometry.cam2_from_cam1 = Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d::UnitX());
    geometry.E = Eigen::Matrix3d::Identity();
    geometry.inlier_matches = matches;
    database.WriteMatches(ImagePairToPairId(1, 2), matches);
    database.WriteTwoViewGeometry(ImagePairToPairId(1, 2), geometry);
    database.WriteMatches(ImagePairToPairId(1, 3), {});
    database.WriteTwoViewGeometry(ImagePairToPairId(1, 3), {});
    database.WriteDepthSamples(1, std::vector<DepthSample>(30));
  }
  const std::string dump = DumpDatabase(path);
  const std::string log = folder_ / "log.txt";
  fs::copy_file(path, folder_ / "other.db");
  RunSql(folder_ / "other.db", "UPDATE images SET name = 'other_' || name");
  const std::string merge = "colmap database_merger --database_path1 " + path +
                            " --database_path2 " + (folder_ / "other.db").string() +
                            " --merged_database_path " + (folder_ / "merged.db").string() + " > " +
                            log + " 2>&1";
  ASSERT_EQ(std::system(merge.c_str()), 0) << log;
  // COLMAP read every row of both and wrote it again.
  const Database merged(folder_ / "merged.db");
  const Database ours(path);
  EXPECT_EQ(merged.ReadImages().size(), 6u);
  EXPECT_EQ(*merged.ReadKeypoints(1), *ours.ReadKeypoints(1));
  EXPECT_EQ(*merged.ReadMatches(ImagePairToPairId(1, 2)),
            *ours.ReadMatches(ImagePairToPairId(1, 2)));
  const TwoViewGeometry geometry = *merged.ReadTwoViewGeometry(ImagePairToPairId(1, 2));
  EXPECT_EQ(geometry.inlier_matches.size(), 30u);
  EXPECT_EQ(geometry.E, ours.ReadTwoViewGeometry(ImagePairToPairId(1, 2))->E);
  EXPECT_EQ(geometry.cam2_from_cam1->translation, Eigen::Vector3d::UnitX());
  // Its merger leaves out the rows of failed pairs.
  EXPECT_FALSE(merged.ReadTwoViewGeometry(ImagePairToPairId(1, 3)));
  EXPECT_EQ(DumpDatabase(path), dump);
}

// Files of other people, of COLMAP before 3.0 to 4.x and of other programs.
TEST_F(ColmapFilesTest, ReadsFilesOfAllVersions) {
  const fs::path originals = SharedDataPath("colmap_databases");
  if (!fs::exists(originals)) GTEST_SKIP() << originals << " is absent";
  for (const fs::directory_entry& original : fs::directory_iterator(originals)) {
    if (original.path().extension() != ".db") continue;  // a log that a reader left
    const fs::path copy = folder_ / original.path().filename();
    fs::copy_file(original.path(), copy);
    fs::permissions(copy, fs::perms::owner_all);
    for (const Database::Mode mode : {Database::Mode::kReadOnly, Database::Mode::kOpenExisting}) {
      const Database database(copy, mode);
      EXPECT_GT(database.ReadImages().size(), 0u) << copy;
      for (const Image& image : database.ReadImages()) database.ReadKeypoints(image.image_id);
      for (const auto& [pair, num] : database.ReadNumInliers()) {
        EXPECT_EQ(static_cast<int>(database.ReadTwoViewGeometry(pair)->inlier_matches.size()), num)
            << copy;
      }
      EXPECT_TRUE(database.FindBadRows().empty()) << copy << database.FindBadRows()[0];
    }
  }
}

TEST_F(ColmapFilesTest, ReadsAColmap42File) {
  const fs::path original = SharedDataPath("strecha_29/colmap_loose_matches.db");
  if (!fs::exists(original)) GTEST_SKIP() << original << " is absent";
  {
    const Database database(original, Database::Mode::kReadOnly);
    EXPECT_EQ(database.ReadImages().size(), 29u);
    EXPECT_EQ(database.ReadMatchedPairIds().size(), 406u);
    EXPECT_EQ(database.ReadKeypoints(1)->size(), 5812u);
    EXPECT_EQ(database.ReadMatches(ImagePairToPairId(1, 2))->size(), 1975u);
    EXPECT_FALSE(database.ReadDescriptors(1));
    EXPECT_FALSE(database.ReadDepthSamples(1));
    EXPECT_FALSE(database.ReadTwoViewGeometry(ImagePairToPairId(1, 2)));
    EXPECT_TRUE(database.ReadJobs("verification").empty());
    EXPECT_EQ(database.ReadCameras()[0].model, CameraModel::kPinhole);
  }
  const fs::path copy = folder_ / "copy.db";
  fs::copy_file(original, copy);
  fs::permissions(copy, fs::perms::owner_all);
  Database database(copy);
  database.WriteDepthSamples(1, std::vector<DepthSample>(5812));
  database.WriteImage({30, "new.jpg", 1});
  EXPECT_EQ(database.ReadImages().size(), 30u);
}

}  // namespace
}  // namespace cairn
