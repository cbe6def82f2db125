// Databases that are damaged, locked or none at all are named, with the reason.
#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <fstream>

#include "support/database_dump.h"
#include "support/test.h"
#include "support/thrown_message.h"
#include "support/unprivileged.h"
#include "unit/database/database_fixture.h"

namespace cairn {
namespace {

class DatabaseFailureTest : public DatabaseTest {};

TEST_F(DatabaseFailureTest, FilesThatAreNoColmapDatabaseAreNamed) {
  std::ofstream(Path("text.db")) << std::string(2000, 'x');
  EXPECT_EQ(ThrownMessage<IoError>([&] { Database database(Path("text.db")); }),
            Path("text.db") + ": is not an SQLite database");
  RunSql(Path("other.db"), "CREATE TABLE bookmarks(x)");
  EXPECT_THAT(ThrownMessage<IoError>([&] { Database database(Path("other.db")); }),
              HasSubstr("is not a COLMAP database: it has no table 'cameras'"));
  EXPECT_EQ(RunSql(Path("other.db"), "SELECT name FROM sqlite_master").size(), 1u);  // Untouched.
  EXPECT_EQ(
      ThrownMessage<IoError>([&] { Database database(Path("no.db"), Database::Mode::kReadOnly); }),
      Path("no.db") + ": no such file");
  EXPECT_EQ(ThrownMessage<IoError>([&] { Database database(folder_.string()); }),
            folder_.string() + ": is a folder");
  EXPECT_EQ(ThrownMessage<IoError>([&] { Database database(Path("no/such/folder.db")); }),
            Path("no/such/folder.db") + ": cannot be opened or created");
}

TEST_F(DatabaseFailureTest, BlobsOfAWrongSizeAreNamed) {
  {
    Database database(Path());
    WriteImages(database, 4);
    database.WriteKeypoints(3, RandomKeypoints(5, 1));
    database.WriteDescriptors(3, Descriptors::Random(5, 128));
    database.WriteMatches(ImagePairToPairId(1, 2), {{0, 0}});
    database.WriteTwoViewGeometry(ImagePairToPairId(1, 2), TestGeometry());
  }
  RunSql(Path(), "UPDATE keypoints SET rows = 6");
  RunSql(Path(), "UPDATE descriptors SET data = X'00'");
  RunSql(Path(), "UPDATE matches SET cols = 3");
  RunSql(Path(), "UPDATE two_view_geometries SET E = X'0011'");
  RunSql(Path(), "UPDATE cameras SET params = X'0011'");
  Database database(Path());
  EXPECT_EQ(ThrownMessage<IoError>([&] { database.ReadKeypoints(3); }),
            Path() + ": keypoints of image 3: 6 x 6 values need 144 bytes, but the blob has 120");
  EXPECT_THAT(ThrownMessage<IoError>([&] { database.ReadDescriptors(3); }),
              HasSubstr("descriptors of image 3: 5 x 128 values need 640 bytes"));
  EXPECT_THAT(ThrownMessage<IoError>([&] { database.ReadMatches(ImagePairToPairId(1, 2)); }),
              HasSubstr("(images 1, 2): 1 x 3 values need 12 bytes, but the blob has 8"));
  EXPECT_THAT(
      ThrownMessage<IoError>([&] { database.ReadTwoViewGeometry(ImagePairToPairId(1, 2)); }),
      HasSubstr("E needs 72 bytes, but the blob has 2"));
  EXPECT_EQ(database.ReadCameras().size(), 0u);
  EXPECT_EQ(database.FindBadRows().at(0),
            "camera 1: its params blob has 2 bytes, its model needs 64");
  RunSql(Path(), "UPDATE keypoints SET rows = -1");
  EXPECT_THAT(ThrownMessage<IoError>([&] { database.ReadKeypoints(3); }),
              HasSubstr("keypoints of image 3"));
  RunSql(Path(), "UPDATE descriptors SET rows = 10, cols = 64, data = zeroblob(640)");
  EXPECT_EQ(ThrownMessage<IoError>([&] { database.ReadDescriptors(3); }),
            Path() + ": descriptors of image 3: 64 columns instead of 128");
  RunSql(Path(), "UPDATE keypoints SET rows = 10, cols = 3");
  EXPECT_THAT(ThrownMessage<IoError>([&] { database.ReadKeypoints(3); }), HasSubstr("3 columns"));
}

TEST_F(DatabaseFailureTest, RowsThatCannotBeWrittenAreNamed) {
  Database database(":memory:");
  WriteImages(database, 2);
  const auto message = [&](const Image& image) {
    return ThrownMessage<IoError>([&] { database.WriteImage(image); });
  };
  EXPECT_EQ(message({3, "image1.jpg", 1}), ":memory:: image 3: image 1 has its name, 'image1.jpg'");
  EXPECT_EQ(message({3, "c.jpg", 7}), ":memory:: image 3: there is no camera 7");
  EXPECT_EQ(message({3, "", 1}), ":memory:: image 3: the name is empty");
  EXPECT_EQ(message({3, "a\nb", 1}), ":memory:: image 3: the name has a line break or a zero byte");
  EXPECT_EQ(message({kInvalidImageId, "c.jpg", 1}),
            ":memory:: image 4294967295: the id is out of range");
  EXPECT_FALSE(database.HasImage(3));
  EXPECT_EQ(ThrownMessage<IoError>([&] { database.WriteKeypoints(3, {}); }),
            ":memory:: keypoints of image 3: there is no such image");
  EXPECT_EQ(ThrownMessage<IoError>([&] { database.WriteDescriptors(3, {}); }),
            ":memory:: descriptors of image 3: there is no such image");
  EXPECT_EQ(ThrownMessage<IoError>([&] { database.WriteDepthSamples(3, {}); }),
            ":memory:: cairn_depth_scales of image 3: there is no such image");
}

TEST_F(DatabaseFailureTest, PolaritiesThatAreNotZeroOrOneADescriptorAreNamed) {
  const Descriptors descriptors = Descriptors::Random(2, 128);
  {
    Database database(Path());
    WriteImages(database, 1);
    database.WriteDescriptors(1, descriptors, {1, 0});
  }
  for (const std::string bad : {"X'01'", "X'010000'", "X'0102'"}) {
    RunSql(Path(), "UPDATE cairn_polarities SET data = " + bad);
    Database database(Path());
    EXPECT_THAT(ThrownMessage<IoError>([&] { database.ReadPolarities(1, descriptors); }),
                HasSubstr("cairn_polarities of image 1: not a 0 or 1 a descriptor"));
  }
}

TEST_F(DatabaseFailureTest, AnotherProgramsLockIsNamed) {
  Database database(Path());
  database.SetBusyTimeout(10);
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open(Path().c_str(), &other), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(other, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
  EXPECT_EQ(ThrownMessage<IoError>([&] { WriteImages(database, 1); }),
            Path() + ": is locked by another program, or elsewhere in this one");
  EXPECT_EQ(ThrownMessage<IoError>([&] { Database::Transaction transaction(database); }),
            Path() + ": is locked by another program, or elsewhere in this one");
  sqlite3_close(other);
  WriteImages(database, 1);  // Goes on when the lock is gone.
}

TEST_F(DatabaseFailureTest, OpeningTheFileAgainKeepsItsLocks) {
  Database database(Path());
  const int file = open(Path().c_str(), O_RDWR | O_CLOEXEC);
  const auto is_locked = [file] {
    struct flock lock = {};
    lock.l_type = F_WRLCK;
    EXPECT_EQ(fcntl(file, F_OFD_GETLK, &lock), 0);
    return lock.l_type != F_UNLCK;
  };
  EXPECT_TRUE(is_locked());
  for (const auto mode : {Database::Mode::kReadOnly, Database::Mode::kOpenExisting}) {
    const Database another(Path(), mode);
    EXPECT_TRUE(is_locked());
  }
  close(file);  // which gives the locks of this process up
}

TEST_F(DatabaseFailureTest, ASnapshotDoesNotSeeWhatIsWrittenLater) {
  Database database(Path());
  WriteImages(database, 2);
  const Database later(Path(), Database::Mode::kReadOnly);
  const Database snapshot(Path(), Database::Mode::kSnapshot);
  EXPECT_EQ(snapshot.ReadImages().size(), 2u);
  WriteImages(database, 3);
  EXPECT_EQ(later.ReadImages().size(), 3u);
  EXPECT_EQ(snapshot.ReadImages().size(), 2u);
}

TEST_F(DatabaseFailureTest, WhoOnlyReadsWritesNothingAndLeavesNoFiles) {
  {
    Database database(Path());
    WriteImages(database, 2);
  }
  for (const auto mode : {Database::Mode::kReadOnly, Database::Mode::kSnapshot}) {
    {
      Database database(Path(), mode);
      EXPECT_EQ(database.ReadImages().size(), 2u);
      EXPECT_THROW(WriteImages(database, 3), IoError);
    }
    EXPECT_FALSE(fs::exists(Path() + "-wal"));
    EXPECT_FALSE(fs::exists(Path() + "-shm"));
  }
}

TEST_F(DatabaseFailureTest, ReadOnlyFoldersCanBeReadAndNotWritten) {
  {
    Database database(Path());
    WriteImages(database, 2);
  }
  ReadOnly(Path());
  ReadOnly(folder_);
  const Unprivileged unprivileged;
  EXPECT_EQ(Database(Path(), Database::Mode::kReadOnly).ReadImages().size(), 2u);
  EXPECT_THAT(ThrownMessage<IoError>([&] { Database database(Path()); }), HasSubstr("read-only"));
  EXPECT_THAT(ThrownMessage<IoError>([&] { Database database(Path("new.db")); }),
              HasSubstr("cannot be opened"));
}

TEST_F(DatabaseFailureTest, ALinkIsReadWithTheLogOfItsFile) {
  fs::create_directory(folder_ / "data");
  fs::create_symlink("data/scene.db", Path());
  Database database(Path("data/scene.db"));
  WriteImages(database, 2);  // which are in the log
  ReadOnly(folder_);
  const Unprivileged unprivileged;
  EXPECT_EQ(Database(Path(), Database::Mode::kReadOnly).ReadImages().size(), 2u);
}

}  // namespace
}  // namespace cairn
