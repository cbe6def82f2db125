// The cameras that photographs get: of EXIF, of the user, shared, computed again.
#include <sys/stat.h>

#include <filesystem>
#include <map>

#include "cairn/base/error.h"
#include "cairn/image/exif.h"
#include "cairn/pipeline/stages.h"
#include "pipeline/stages/recompute.h"
#include "support/shared_data.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "support/thrown_message.h"
#include "unit/pipeline/import_photos_fixture.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

CameraOptions GivenPinhole(const std::vector<double>& params) {
  CameraOptions options;
  options.camera_model = CameraModel::kPinhole;
  options.camera_params = params;
  return options;
}

TEST_F(ImportPhotosTest, CameraParamsAndSingleCamera) {
  AddPhoto("a.png");
  AddPhoto("b.png");
  CameraOptions options = GivenPinhole({70, 71, 32, 24});
  options.single_camera = true;
  Import(options);
  const std::vector<Camera> cameras = database_.ReadCameras();
  ASSERT_EQ(cameras.size(), 1u);
  EXPECT_EQ(cameras[0].params, options.camera_params);
  EXPECT_TRUE(cameras[0].has_prior_focal_length);
  // Photographs that join later have the same camera.
  AddPhoto("c.png");
  Import(options);
  EXPECT_EQ(database_.ReadCameras().size(), 1u);
  EXPECT_EQ(database_.ReadImages()[2].camera_id, 1u);
}

TEST_F(ImportPhotosTest, OneCameraASubFolder) {
  for (const char* folder : {"/left", "/right"})
    std::filesystem::create_directory(images_ + folder);
  for (const char* name : {"left/a.png", "left/b.png", "right/a.png", "top.png"}) AddPhoto(name);
  CameraOptions options;
  options.single_camera_per_folder = true;
  Import(options);
  EXPECT_THAT(CameraIds(), ElementsAre(1, 1, 2, 3));
  // Photographs that join later have the cameras of their folders; other sizes do not fit.
  AddPhoto("right/b.png");
  AddPhoto("right/c.png", 32, 32);
  TestMonitor monitor;
  Import(options, monitor);
  EXPECT_THAT(CameraIds(), ElementsAre(1, 1, 2, 3, 2));
  EXPECT_THAT(monitor.warnings(),
              ElementsAre("right/c.png: is 32 x 32 pixels, the single camera of its folder 64 x 48 "
                          "(without --single_camera_per_folder it has its own); skipped"));
  options.single_camera = true;
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { Import(options); }),
              HasSubstr("single_camera_per_folder: single_camera is given, too"));
}

TEST_F(ImportPhotosTest, WrongCameraParamsAreNamed) {
  AddPhoto("a.png");
  CameraOptions options;
  options.camera_params = {1, 2, 3};
  EXPECT_EQ(ThrownMessage<ConfigError>([&] { Import(options); }),
            "camera_params: SIMPLE_RADIAL has 4 parameters, 3 are given");
  options.camera_params = {-1, 2, 3, 0};
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { Import(options); }), HasSubstr("camera_params: "));
  EXPECT_TRUE(database_.ReadImages().empty());
}

TEST_F(ImportPhotosTest, CameraParamsThatNoCameraHasAreRefused) {
  AddPhoto("a.png");
  const CameraOptions options = GivenPinhole({140, 142, 64, 48});
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { Import(options); }),
              AllOf(HasSubstr("camera_params: a.png: the principal point 64,48 lies outside"),
                    HasSubstr("Here it is then 70,71,32,24")));
  EXPECT_TRUE(database_.ReadImages().empty());
}

TEST_F(ImportPhotosTest, DoubtfulCameraParamsAreToldOnce) {
  for (const std::string name : {"a.png", "b.png"}) AddPhoto(name);
  const CameraOptions options = GivenPinhole({35, 35, 16, 12});
  const StageReport report = Import(options);
  ASSERT_EQ(report.warnings.size(), 1u);
  EXPECT_THAT(report.warnings[0].what, HasSubstr("the given principal point 16,12 is far"));
  EXPECT_THAT(report.messages, ElementsAre(WarningText(report.warnings[0])));
  EXPECT_EQ(report.Value("skipped"), 0);
  EXPECT_TRUE(Import(options).warnings.empty());
}

TEST_F(ImportPhotosTest, CameraParamsForPhotographsOfSeveralSizesAreToldWithTheSizes) {
  AddPhotoOf(35, "One", "a.jpg");
  const CameraOptions options = GivenPinhole({65, 65, 32, 24});
  EXPECT_TRUE(Import(options).warnings.empty());
  AddPhoto("b.png", 72, 54);  // joins
  const StageReport report = Import(options);
  ASSERT_EQ(report.warnings.size(), 1u);
  EXPECT_THAT(report.warnings[0].what, HasSubstr("cannot be right for all: 64 x 48, 72 x 54"));
}

TEST_F(ImportPhotosTest, AGivenFocalLengthThatIsNotExifsIsTold) {
  AddPhotoOf(35, "One", "a.jpg");  // 64.7 pixels
  const CameraOptions options = GivenPinhole({130, 130, 32, 24});
  const StageReport report = Import(options);
  ASSERT_EQ(report.warnings.size(), 1u);
  EXPECT_THAT(report.warnings[0].what, HasSubstr("focal length of 130 pixels is not EXIF's, 65"));
}

TEST_F(ImportPhotosTest, GpsOfExifIsWhereColmapHasIt) {
  AddPhoto("a.jpg");
  WriteExif(images_ + "/a.jpg", {.gps = GpsPosition{45.5, 7.25, 300}});
  AddPhoto("b.jpg");
  Import();
  const std::map<image_t, GpsPosition> positions = database_.ReadGpsPriors();
  ASSERT_EQ(positions.size(), 1u);
  EXPECT_NEAR(positions.at(1).latitude_deg, 45.5, 1e-6);
  EXPECT_NEAR(positions.at(1).longitude_deg, 7.25, 1e-6);
  EXPECT_EQ(positions.at(1).altitude_m, 300);
}

TEST_F(ImportPhotosTest, PanoramasHaveTheirModel) {
  AddPhoto("a.jpg", 128, 64);
  WriteExif(images_ + "/a.jpg", {.is_panorama = true});
  AddPhoto("b.jpg", 128, 64);
  Import();
  const std::vector<Camera> cameras = database_.ReadCameras();
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_EQ(cameras[0].model, CameraModel::kEquirectangular);
  EXPECT_EQ(cameras[1].model, CameraModel::kSimpleRadial);
}

TEST_F(ImportPhotosTest, EqualExifSharesACamera) {
  AddPhotoOf(35, "One", "a.jpg");
  AddPhotoOf(50, "One", "b.jpg");
  AddPhotoOf(35, "One", "c.jpg");
  AddPhotoOf(35, "Two", "d.jpg");
  AddPhoto("e.jpg");
  AddPhoto("f.jpg");
  Import();
  EXPECT_THAT(CameraIds(), ElementsAre(1, 2, 1, 3, 4, 5));
  const Camera camera = database_.ReadCameras()[0];
  EXPECT_TRUE(camera.has_prior_focal_length);
  EXPECT_NEAR(camera.FocalX(), 35 / 43.27 * 80, 0.05);
}

// More photographs of a camera that is known already do not make it a new, unknown one.
TEST_F(ImportPhotosTest, PhotographsThatJoinShareTheCameraOfEqualExif) {
  AddPhotoOf(35, "One", "b.jpg");
  AddPhotoOf(35, "One", "c.jpg");
  AddPhoto("d.jpg");
  Import();
  AddPhotoOf(35, "One", "a.jpg");
  AddPhotoOf(50, "One", "e.jpg");
  fs::remove(images_ + "/b.jpg");  // (the first of its camera)
  Import();
  EXPECT_THAT(Names(), ElementsAre("b.jpg", "c.jpg", "d.jpg", "a.jpg", "e.jpg"));
  EXPECT_THAT(CameraIds(), ElementsAre(1, 1, 2, 1, 3));
}

TEST_F(ImportPhotosTest, PhotographsOfAnotherSizeDoNotFitTheSingleCamera) {
  AddPhoto("a.png");
  AddPhoto("b.png", 32, 32);
  CameraOptions options;
  options.single_camera = true;
  TestMonitor monitor;
  Import(options, monitor);
  EXPECT_THAT(Names(), ElementsAre("a.png"));
  EXPECT_THAT(monitor.warnings(),
              ElementsAre("b.png: is 32 x 32 pixels, the single camera 64 x 48 (without "
                          "--single_camera it has its own); skipped"));
}

TEST_F(ImportPhotosTest, TheSingleCameraHasTheSizeThatMostPhotographsHave) {
  AddPhoto("0thumbnail.png", 32, 32);
  for (const std::string name : {"a.png", "b.png"}) AddPhoto(name);
  CameraOptions options;
  options.single_camera = true;
  Import(options);
  EXPECT_THAT(Names(), ElementsAre("a.png", "b.png"));
  for (const std::string name : {"c.png", "d.png", "e.png"}) AddPhoto(name, 32, 32);
  Import(options);  // what is there stays
  EXPECT_THAT(Names(), ElementsAre("a.png", "b.png"));
}

TEST_F(ImportPhotosTest, OtherCameraOptionsAreAnErrorUnlessCamerasAreRecomputed) {
  AddPhoto("a.png");
  AddPhoto("b.png");
  Import();
  database_.WriteKeypoints(1, std::vector<Keypoint>(3));
  CameraOptions options;
  options.camera_model = CameraModel::kPinhole;
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { Import(options); }),
              HasSubstr("camera_model: is \"PINHOLE\""));
  PrepareRecompute(database_, BuildStage::kCameras, images_, {});
  options.single_camera = true;
  Import(options);
  ASSERT_EQ(database_.ReadCameras().size(), 1u);
  EXPECT_EQ(database_.ReadCameras()[0].model, CameraModel::kPinhole);
  EXPECT_EQ(database_.ReadImages()[1].camera_id, 1u);
  EXPECT_EQ(database_.ReadKeypoints(1)->size(), 3u);
}

TEST_F(ImportPhotosTest, RecomputedCamerasSpareThoseOfPhotographsThatCannotBeReadForNow) {
  AddPhoto("a.png");
  AddPhoto("b.png", 32, 32);
  Import();
  PrepareRecompute(database_, BuildStage::kCameras, images_, {});
  fs::remove(images_ + "/b.png");
  ASSERT_EQ(mkfifo((images_ + "/b.png").c_str(), 0600), 0);
  Import();
  EXPECT_THAT(CameraIds(), ElementsAre(3, 2));
  EXPECT_EQ(database_.ReadCameras()[0].width, 32);
  fs::remove(images_ + "/b.png");
  AddPhoto("c.png");
  PrepareRecompute(database_, BuildStage::kCameras, images_, {});
  ImportPhotos(database_, {images_, std::vector<PhotoSource::Photo>{{"a.png", std::nullopt}}});
  EXPECT_EQ(CameraIds()[1], 2u);
}

TEST_F(ImportPhotosTest, NoCameraIdIsLeft) {
  AddPhoto("a.png");
  database_.WriteCamera(Camera::FromFocal(kInvalidCameraId - 1, CameraModel::kOpenCV, 99, 64, 48));
  EXPECT_THAT(ThrownMessage<IoError>([&] { Import(); }),
              HasSubstr("cameras have ids below 4294967295"));
  EXPECT_THAT(Names(), IsEmpty());
}

TEST_F(ImportPhotosTest, EqualExifAndEqualGivenFocalShareACamera) {
  std::vector<PhotoSource::Photo> selection;
  for (const auto& [name, focal_px] : std::map<std::string, double>{
           {"a.jpg", 70.5}, {"b.jpg", 70.5}, {"c.jpg", 71.0}, {"d.jpg", 70.5}}) {
    AddPhoto(name, 64, 48);
    if (name != "d.jpg") WriteExif(images_ + "/" + name, {35, "Maker", "One"});
    selection.push_back({name, focal_px});
  }
  ImportPhotos(database_, {images_, selection});
  EXPECT_THAT(CameraIds(), ElementsAre(1, 1, 2, 3));
  EXPECT_EQ(database_.ReadCameras()[0].FocalX(), 70.5);
}

// As COLMAP 3.8 does on these photographs of one camera.
TEST_F(ImportPhotosTest, LundDoorHasOneCameraFromExif) {
  const std::string photos = SharedDataPath("lund_door/images");
  if (!fs::exists(photos)) GTEST_SKIP() << photos << " is absent";
  ImportPhotos(database_, {photos});
  EXPECT_EQ(database_.ReadImages().size(), 12u);
  ASSERT_EQ(database_.ReadCameras().size(), 1u);
  EXPECT_TRUE(database_.ReadCameras()[0].has_prior_focal_length);
}

}  // namespace
}  // namespace cairn
