#include <sys/stat.h>

#include <filesystem>
#include <map>

#include "cairn/base/error.h"
#include "cairn/pipeline/stages.h"
#include "pipeline/stages/recompute.h"
#include "support/database_dump.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "support/test_photos.h"
#include "support/thrown_message.h"
#include "unit/pipeline/import_photos_fixture.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

TEST_F(ImportPhotosTest, ImagesAreInTheOrderOfTheirNamesWithACameraEach) {
  AddPhoto("b.png", 80, 60);
  AddPhoto("a/z.png");
  AddPhoto("c.png");
  const StageReport report = Import();
  EXPECT_EQ(report.status, StageStatus::kOk);
  EXPECT_THAT(Names(), ElementsAre("a/z.png", "b.png", "c.png"));
  const std::vector<Camera> cameras = database_.ReadCameras();
  ASSERT_EQ(cameras.size(), 3u);
  EXPECT_EQ(cameras[1].model, CameraModel::kSimpleRadial);
  EXPECT_EQ(cameras[1].width, 80);
  EXPECT_EQ(cameras[1].height, 60);
  EXPECT_FALSE(cameras[1].has_prior_focal_length);
  EXPECT_EQ(cameras[1].params, (std::vector<double>{1.2 * 80, 40, 30, 0}));
  EXPECT_EQ(database_.ReadImages()[2].camera_id, 3u);
}

// Written to a database, it would end the run when the model is written.
TEST_F(ImportPhotosTest, ANameWithALineBreakIsRefusedAtOnce) {
  AddPhoto("a.png");
  AddPhoto("b\nc.png");
  TestMonitor monitor;
  Import({}, monitor);
  EXPECT_THAT(Names(), ElementsAre("a.png"));
  EXPECT_THAT(monitor.warnings(), ElementsAre(HasSubstr("a name with a line break; skipped")));
}

TEST_F(ImportPhotosTest, WhatIsNotReadAndWhatIsGoneIsNamed) {
  AddPhoto("a.png");
  AddPhoto("b.png");
  AddFile("c.GIF", "GIF89a");
  AddFile("notes.txt", "");
  TestMonitor first, second;
  Import({}, first);
  EXPECT_THAT(first.warnings(), ElementsAre(HasSubstr("their format is not known: c.GIF")));
  fs::remove(images_ + "/c.GIF");
  fs::remove(images_ + "/a.png");
  Import({}, second);
  EXPECT_THAT(second.warnings(),
              ElementsAre(HasSubstr("no longer has 1 photographs of the database: a.png; their")));
  EXPECT_THAT(Names(), ElementsAre("a.png", "b.png"));
}

// Removes a file when the first photograph's hash is known.
class Remover : public TestMonitor {
 public:
  explicit Remover(std::string path) : path_(std::move(path)) {}
  void Advance(int64_t num_done) override {
    fs::remove(path_);
    TestMonitor::Advance(num_done);
  }

 private:
  const std::string path_;
};

TEST_F(ImportPhotosTest, WhatCannotBeReadForNowIsTriedAgain) {
  AddPhoto("a.png");
  AddPhoto("b.png");
  Remover remover(images_ + "/a.png");
  ImportPhotos(database_, {images_}, {}, {.num_threads = 1, .monitor = remover});
  EXPECT_THAT(remover.warnings(), ElementsAre("a.png: No such file or directory; skipped"));
  AddPhoto("a.png");
  Import();
  EXPECT_THAT(Names(), ElementsAre("b.png", "a.png"));
}

TEST_F(ImportPhotosTest, APhotographThatCannotBeReadForNowDidNotChange) {
  AddPhoto("a.png");
  AddPhoto("b.png");
  Import();
  fs::remove(images_ + "/a.png");
  ASSERT_EQ(mkfifo((images_ + "/a.png").c_str(), 0600), 0);
  TestMonitor monitor;
  Import({}, monitor);
  EXPECT_THAT(monitor.warnings(), ElementsAre(HasSubstr("a.png: is a pipe or a device, not a file; "
                                                        "what the database has of it stays")));
  EXPECT_THAT(Names(), ElementsAre("a.png", "b.png"));
}

TEST_F(ImportPhotosTest, WhatIsGoneIsTakenOutWhereTold) {
  for (const std::string name : {"a.png", "b.png", "c.png"}) AddPhoto(name);
  Import();
  fs::remove(images_ + "/b.png");
  TestMonitor monitor;
  ImportPhotos(database_, {.image_path = images_, .drop_missing = true}, {}, {.monitor = monitor});
  EXPECT_THAT(monitor.warnings(), ElementsAre(HasSubstr("b.png; taken out of it")));
  EXPECT_THAT(Names(), ElementsAre("a.png", "c.png"));
  EXPECT_EQ(database_.ReadCameras().size(), 2u);
  EXPECT_EQ(database_.ReadPhotos().size(), 2u);
  // It can come back.
  AddPhoto("b.png");
  Import();
  EXPECT_THAT(Names(), ElementsAre("a.png", "c.png", "b.png"));
}

TEST_F(ImportPhotosTest, WhatIsGoneIsTakenOutWhoeverAddedIt) {
  AddPhoto("a.png");
  AddForeignImage("gone.png");
  Import();
  EXPECT_THAT(Names(), ElementsAre("gone.png", "a.png"));
  ImportPhotos(database_, {.image_path = images_, .drop_missing = true});
  EXPECT_THAT(Names(), ElementsAre("a.png"));
}

// One that was skipped shows which folder it is.
TEST_F(ImportPhotosTest, WhatIsGoneIsTakenOutThoughAllElseWasSkipped) {
  AddPhoto("a.png");
  AddFile("b.png", "broken");
  Import();
  fs::remove(images_ + "/a.png");
  AddPhoto("c.png");
  ImportPhotos(database_, {.image_path = images_, .drop_missing = true});
  EXPECT_THAT(Names(), ElementsAre("c.png"));
}

TEST_F(ImportPhotosTest, MasksBelowThePhotographsAreNone) {
  for (const std::string name : {"a.png", "masks/a.png.png", "depth/a.png.png"}) AddPhoto(name);
  ImportPhotos(database_,
               {.image_path = images_, .other_paths = {images_ + "/masks", images_ + "/depth"}});
  EXPECT_THAT(Names(), ElementsAre("a.png"));
}

TEST_F(ImportPhotosTest, AnotherFolderDoesNotEmptyTheDatabase) {
  AddPhoto("a.png");
  Import();
  fs::create_directories(folder_ / "other");
  EXPECT_THAT(ThrownMessage<ConfigError>([&] {
                ImportPhotos(database_, {.image_path = folder_ / "other", .drop_missing = true});
              }),
              HasSubstr("has none of the photographs of the database"));
  EXPECT_THAT(Names(), ElementsAre("a.png"));
}

TEST_F(ImportPhotosTest, FilesThatAreNoPhotographsAreSkippedWithOneLineEach) {
  AddPhoto("good.png");
  AddFile("empty.jpg", "");
  AddFile("text.jpg", "this is not a photograph\n");
  TestMonitor monitor;
  const StageReport report = Import({}, monitor);
  EXPECT_EQ(report.status, StageStatus::kWarning);
  EXPECT_THAT(Names(), ElementsAre("good.png"));
  EXPECT_THAT(monitor.warnings(), ElementsAre(HasSubstr("empty.jpg: "), HasSubstr("text.jpg: ")));
  const std::vector<PhotoRecord> photos = database_.ReadPhotos();
  ASSERT_EQ(photos.size(), 3u);
  EXPECT_NE(photos[0].error, "");
  EXPECT_EQ(photos[1].error, "");
  // Again: they are named again, and nothing changes.
  TestMonitor again;
  Import({}, again);
  EXPECT_THAT(again.warnings(),
              ElementsAre(HasSubstr("still skipped"), HasSubstr("still skipped")));
  // Once the file is good, it joins.
  AddPhoto("text.png");
  fs::rename(images_ + "/text.png", images_ + "/text.jpg");
  Import();
  EXPECT_THAT(Names(), ElementsAre("good.png", "text.jpg"));
}

TEST_F(ImportPhotosTest, CopiesOfAPhotographAreNamed) {
  AddPhoto("a.png");
  AddPhoto("b.png");
  EXPECT_THAT(Import().warnings, IsEmpty());
  fs::copy(images_ + "/a.png", images_ + "/a (1).png");
  for (int run = 0; run < 2; ++run) {
    const std::vector<ResultWarning> warnings = Import().warnings;
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_THAT(warnings[0].what, HasSubstr("copies of others (1): a.png (of a (1).png)"));
  }
  EXPECT_EQ(Names().size(), 3u);
}

TEST_F(ImportPhotosTest, ARenamedPhotographIsACopyOfOneThatIsGone) {
  for (const std::string name : {"a.png", "b.png"}) AddPhoto(name);
  WriteBitmap(images_ + "/a.png", WallPhoto(64, 48, 5));
  Import();
  fs::rename(images_ + "/a.png", images_ + "/c.png");
  const std::vector<ResultWarning> warnings = Import().warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0].what, HasSubstr("c.png (of a.png)"));
  EXPECT_THAT(warnings[0].advice, HasSubstr("--drop_missing, where one was renamed"));
  ImportPhotos(database_, {.image_path = images_, .drop_missing = true});
  EXPECT_THAT(Import().warnings, IsEmpty());
}

TEST_F(ImportPhotosTest, AChangedPhotographIsNoticed) {
  AddPhoto("a.png");
  Import();
  WriteBitmap(images_ + "/a.png", WallPhoto(64, 48, 5));
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { Import(); }),
              AllOf(HasSubstr("a.png changed since"), HasSubstr("--recompute changed")));
}

TEST_F(ImportPhotosTest, ChangedPhotographsAloneAreNewOnRequest) {
  for (const std::string name : {"a.png", "b.png", "c.png"}) AddPhoto(name);
  Import();
  for (const image_t id : {1, 2, 3}) database_.WriteKeypoints(id, std::vector<Keypoint>(3));
  database_.WriteMatches(ImagePairToPairId(1, 2), {{0, 0}});
  database_.WriteMatches(ImagePairToPairId(1, 3), {{0, 0}});
  WriteBitmap(images_ + "/b.png", WallPhoto(80, 60, 5));
  AddFile("c.png", "this is not a photograph\n");
  fs::remove(images_ + "/a.png");
  TestMonitor monitor;
  const StageReport report = ImportPhotos(
      database_, {.image_path = images_, .recompute_changed = true}, {}, {.monitor = monitor});
  EXPECT_THAT(report.messages, Contains("changed, and computed again: b.png, c.png"));
  EXPECT_THAT(Names(), ElementsAre("a.png", "b.png"));
  EXPECT_EQ(database_.ReadNumKeypoints(), (std::map<image_t, int>{{1, 3}}));
  EXPECT_TRUE(database_.ReadNumMatches().empty());
  EXPECT_EQ(database_.ReadCameras().back().width, 80);
  // Nothing is left to do, and the file that was damaged can come back.
  EXPECT_EQ(Import().Value("new_images"), 0);
  AddPhoto("c.png");
  Import();
  EXPECT_THAT(Names(), ElementsAre("a.png", "b.png", "c.png"));
}

TEST_F(ImportPhotosTest, ImagesOfAnotherProgramKeepTheirCameras) {
  AddPhoto("a.png");
  AddPhoto("b.png");
  AddForeignImage("a.png");
  EXPECT_EQ(Import().Value("skipped"), 0);
  EXPECT_THAT(Names(), ElementsAre("a.png", "b.png"));
  EXPECT_EQ(database_.ReadImages()[0].camera_id, 5u);
  EXPECT_EQ(database_.ReadImages()[1].image_id, 8u);
  EXPECT_EQ(database_.ReadImages()[1].camera_id, 6u);
  PrepareRecompute(database_, BuildStage::kCameras, images_, {});
  CameraOptions options;
  options.camera_model = CameraModel::kPinhole;
  TestMonitor monitor;
  Import(options, monitor);
  EXPECT_THAT(monitor.warnings(),
              ElementsAre(HasSubstr("1 photographs have features of another program")));
  EXPECT_EQ(database_.ReadImages()[0].camera_id, 5u);
  EXPECT_EQ(database_.ReadCameras()[0].model, CameraModel::kOpenCV);
  EXPECT_EQ(database_.ReadCameras()[1].model, CameraModel::kPinhole);
}

TEST_F(ImportPhotosTest, RowsThatCannotBeUsedAreNotOverwritten) {
  const std::string path = folder_ / "a.db";
  Database database(path);
  for (const camera_t id : {5, 6}) {
    database.WriteCamera(Camera::FromFocal(id, CameraModel::kOpenCV, 99, 64, 48));
    database.WriteImage({id + 2, "foreign" + std::to_string(id), id});
  }
  RunSql(path,
         "UPDATE cameras SET params = X'00' WHERE camera_id = 6;"
         "UPDATE images SET name = '' WHERE image_id = 8");
  AddPhoto("a.png");
  EXPECT_EQ(ImportPhotos(database, {images_}).Value("new_images"), 1);
  EXPECT_EQ(RunSql(path, "SELECT camera_id, hex(params) FROM cameras WHERE camera_id = 6"),
            (SqlRows{{"6", "00"}}));
  EXPECT_EQ(RunSql(path, "SELECT image_id, name, camera_id FROM images ORDER BY image_id"),
            (SqlRows{{"7", "foreign5", "5"}, {"8", "", "6"}, {"9", "a.png", "7"}}));
}

TEST_F(ImportPhotosTest, UndistortedImagesAreToldFromNone) {
  fs::create_directories(images_ + "/images");
  WriteBitmap(images_ + "/images/a.png", WallPhoto(64, 48, 0));
  AddFile(".cairn-images", "");
  EXPECT_THAT(ThrownMessage<IoError>([&] { Import(); }), HasSubstr("images/ holds undistorted"));
}

TEST_F(ImportPhotosTest, NoPhotographsAtAllIsAnError) {
  EXPECT_THROW(Import(), IoError);
  EXPECT_THROW(ImportPhotos(database_, {folder_ / "no_such_folder"}), IoError);
}

TEST_F(ImportPhotosTest, ASelectionTakesNamedPhotosAndTheirFocalLengths) {
  AddPhoto("a.png");
  AddPhoto("b.png");
  const std::vector<PhotoSource::Photo> selection{{"b.png", 123.0}, {"missing.png", std::nullopt}};
  TestMonitor monitor;
  ImportPhotos(database_, {images_, selection}, {}, {.monitor = monitor});
  EXPECT_THAT(Names(), ElementsAre("b.png"));
  EXPECT_EQ(database_.ReadCameras()[0].FocalX(), 123);
  EXPECT_TRUE(database_.ReadCameras()[0].has_prior_focal_length);
  EXPECT_THAT(monitor.warnings(), ElementsAre(HasSubstr("missing.png: ")));
}

}  // namespace
}  // namespace cairn
