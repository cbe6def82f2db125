#include <cmath>
#include <filesystem>
#include <fstream>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/image/resample.h"
#include "cairn/io/colmap_model.h"
#include "cairn/undistortion/undistort.h"
#include "image/codecs.h"
#include "support/check_consistency.h"
#include "support/synthetic_reconstruction.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

// A model of five distorted photographs, one in a folder of its own, all of which are there.
class UndistortImagesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    model_ = MakeSyntheticScene({.num_images = 5, .num_points = 40, .model = CameraModel::kOpenCV})
                 .truth;
    Camera& camera = model_.cameras.at(1);
    camera.width = 200;
    camera.height = 150;
    for (const int i : {0, 1, 2, 3}) camera.params[i] /= 5;
    for (auto& [id, image] : model_.images) {
      image.image.name = (id == 4 ? "more/image" : "image") + std::to_string(id) + ".png";
      for (Eigen::Vector2d& point : image.points2D) point /= 5;
      WritePhoto(id, 0);
    }
    job_ = {.image_path = folder_ / "photos", .output_path = folder_ / "dense"};
  }

  void WritePhoto(image_t id, int shift) {
    Bitmap bitmap{200, 150, 3, {}};
    for (int y = 0; y < 150; ++y) {
      for (int x = 0; x < 200; ++x) {
        for (int c = 0; c < 3; ++c) {
          bitmap.data.push_back(
              static_cast<uint8_t>((x * x + y * (7 + c) + 31 * id + shift) % 251));
        }
      }
    }
    const fs::path path = fs::path(folder_ / "photos") / model_.images.at(id).image.name;
    CreateFolders(path.parent_path().string());
    WriteBitmap(path.string(), bitmap);
  }

  UndistortReport Run(int num_threads = 2, ProgressMonitor& monitor = NullMonitor()) {
    return UndistortImages(model_, job_, options_,
                           {.num_threads = num_threads, .monitor = monitor});
  }
  std::string Dense(const std::string& name) const { return folder_ / "dense/" + name; }
  // The content of every file, without the hidden ones.
  static std::map<std::string, std::string> Files(const std::string& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      const std::string name = fs::relative(entry.path(), folder).string();
      if (entry.is_regular_file() && !name.starts_with('.')) {
        files[name] = ReadFile(entry.path().string());
      }
    }
    return files;
  }

  TempFolder folder_;
  Reconstruction model_;
  UndistortJob job_;
  UndistortOptions options_;
};

TEST_F(UndistortImagesTest, WritesImagesModelAndStereoConfiguration) {
  job_.effective_toml = "# options\n";
  const UndistortReport report = Run();
  EXPECT_EQ(report.num_written, 5);
  EXPECT_TRUE(report.failed.empty());
  const Reconstruction model = ReadColmapModel(Dense("sparse"));
  EXPECT_EQ(model.NumObservations(), model_.NumObservations());
  for (const auto& [id, image] : model.images) {
    const Camera& camera = model.CameraOf(image);
    const Bitmap written = ReadBitmap(Dense("images/") + image.image.name, BitmapColor::kRgb);
    const Bitmap photo = ReadBitmap(job_.image_path + "/" + image.image.name, BitmapColor::kRgb);
    EXPECT_EQ(written.data, ResampleBitmap(photo, model_.cameras.at(1), camera).data);
  }
  EXPECT_EQ(ReadFile(Dense("stereo/fusion.cfg")),
            "image1.png\nimage2.png\nimage3.png\nmore/image4.png\nimage5.png\n");
  EXPECT_TRUE(ReadFile(Dense("stereo/patch-match.cfg"))
                  .starts_with("image1.png\n__auto__, 20\nimage2.png\n"));
  EXPECT_TRUE(fs::is_directory(Dense("stereo/depth_maps/more")));
  EXPECT_EQ(ReadFile(Dense("effective.toml")), "# options\n");
}

// Trainers of Gaussian splatting leave out what is transparent; dense stereo has no use for it.
TEST_F(UndistortImagesTest, KeepsOpacityForGaussianSplatting) {
  const std::string photo_path = job_.image_path + "/image1.png";
  const Bitmap photo = ReadBitmap(photo_path, BitmapColor::kRgb);
  const Bitmap opacity = ReadBitmap(photo_path, BitmapColor::kGray);
  const std::vector<uint8_t> bytes = EncodeImage(photo_path, ".png", photo, 95, &opacity);
  WriteFileAtomically(photo_path, std::string(bytes.begin(), bytes.end()));
  Run();
  EXPECT_FALSE(ReadOpacity(Dense("images/image1.png")));
  job_.layout = DenseLayout::kGaussianSplatting;
  job_.output_path = folder_ / "splats";
  Run();
  const Reconstruction model = ReadColmapModel(job_.output_path + "/sparse/0");
  const auto written = ReadOpacity(job_.output_path + "/images/image1.png");
  ASSERT_TRUE(written);
  EXPECT_EQ(written->data,
            ResampleBitmap(opacity, model_.cameras.at(1), model.CameraOf(model.images.at(1))).data);
  EXPECT_FALSE(ReadOpacity(job_.output_path + "/images/image2.png"));
  // In one folder after another layout, with the same cameras.
  options_.center_principal_point = true;
  job_.overwrites = true;
  Run();
  EXPECT_TRUE(ReadOpacity(job_.output_path + "/images/image1.png"));
  job_.layout = DenseLayout::kColmap;
  Run();
  EXPECT_FALSE(ReadOpacity(job_.output_path + "/images/image1.png"));
}

// As the loader of "3D Gaussian Splatting for Real-Time Radiance Field Rendering" has it: pinhole
// cameras alone, whose principal points it does not read, images in images/ by the last part of
// their names, of their cameras' sizes.
TEST_F(UndistortImagesTest, WritesWhatGaussianSplattingReads) {
  job_.layout = DenseLayout::kGaussianSplatting;
  // Two names that would be one.
  model_.images.at(5).image.name = "more_image4.png";
  WritePhoto(5, 0);
  EXPECT_EQ(Run().num_written, 5);
  const Reconstruction model = ReadColmapModel(Dense("sparse/0"));
  std::set<std::string> files;
  for (const auto& [id, image] : model.images) {
    const Camera& camera = model.CameraOf(image);
    EXPECT_EQ(camera.model, CameraModel::kPinhole);
    EXPECT_EQ(camera.PrincipalPoint(), Eigen::Vector2d(camera.width, camera.height) / 2);
    const std::string file = fs::path(image.image.name).filename().string();
    const Bitmap bitmap = ReadBitmap(Dense("images/") + file, BitmapColor::kRgb);
    EXPECT_EQ(bitmap.width, camera.width);
    EXPECT_EQ(bitmap.height, camera.height);
    const Bitmap photo =
        ReadBitmap(job_.image_path + "/" + model_.images.at(id).image.name, BitmapColor::kRgb);
    EXPECT_EQ(bitmap.data, ResampleBitmap(photo, model_.cameras.at(1), camera).data) << file;
    files.insert(file);
  }
  EXPECT_EQ(files.size(), 5u);
  EXPECT_GT(model.points3D.size(), 20u);
  EXPECT_EQ(Run().num_kept, 5);
  EXPECT_FALSE(fs::exists(Dense("stereo")));
  EXPECT_FALSE(fs::exists(Dense("sparse/cameras.bin")));
}

TEST_F(UndistortImagesTest, BytesDoNotDependOnThreads) {
  Run(1);
  const auto one = Files(folder_ / "dense");
  fs::remove_all(folder_ / "dense");
  Run(8);
  EXPECT_EQ(Files(folder_ / "dense"), one);
}

TEST_F(UndistortImagesTest, ContinuesAfterAnInterruption) {
  Run();
  const auto whole = Files(folder_ / "dense");
  fs::remove_all(folder_ / "dense");
  TestMonitor monitor(2);
  const UndistortReport first = Run(1, monitor);
  EXPECT_TRUE(first.was_stopped);
  EXPECT_EQ(first.num_written, 2);
  EXPECT_FALSE(fs::exists(Dense("sparse")));
  // Killed between the ledger's line and the image, and within a line.
  fs::remove(Dense("images/image2.png"));
  std::ofstream(Dense(".cairn-images"), std::ios::app) << "0123456789";
  const UndistortReport second = Run();
  EXPECT_EQ(second.num_kept, 1);
  EXPECT_EQ(second.num_written, 4);
  EXPECT_EQ(Files(folder_ / "dense"), whole);
  EXPECT_EQ(Run().num_kept, 5);
}

TEST_F(UndistortImagesTest, RedoesOnlyWhatChanged) {
  Run();
  WritePhoto(3, 5);
  UndistortReport report = Run();
  EXPECT_EQ(report.num_written, 1);
  EXPECT_EQ(report.num_kept, 4);
  fs::remove(Dense("images/image1.png"));
  EXPECT_EQ(Run().num_written, 1);
  model_.cameras.at(1).params[4] *= 1.1;
  EXPECT_EQ(Run().num_written, 5);
  options_.max_image_size = 60;
  EXPECT_EQ(Run().num_written, 5);
  // Poses are not in the images, but in the model.
  model_.images.at(2).cam_from_world.translation.x() += 0.5;
  EXPECT_EQ(Run().num_kept, 5);
  EXPECT_EQ(ReadColmapModel(Dense("sparse")).images.at(2).cam_from_world.translation,
            model_.images.at(2).cam_from_world.translation);
}

TEST_F(UndistortImagesTest, WhileImagesChangeThereIsNoModel) {
  Run();
  model_.cameras.at(1).params[4] *= 1.1;
  TestMonitor monitor(1);
  EXPECT_TRUE(Run(1, monitor).was_stopped);
  EXPECT_FALSE(fs::exists(Dense("sparse/images.bin")));
  EXPECT_FALSE(fs::exists(Dense("stereo/fusion.cfg")));
  EXPECT_EQ(Run().num_kept, 1);
  EXPECT_TRUE(fs::exists(Dense("sparse/images.bin")));
}

TEST_F(UndistortImagesTest, ImagesThatLeftTheModelAreRemoved) {
  Run();
  const auto names = [&] { return Files(Dense("images")).size(); };
  EXPECT_EQ(names(), 5u);
  for (auto& [id, point] : model_.points3D) {
    std::erase_if(point.track, [](const TrackElement& e) { return e.image_id == 5; });
  }
  model_.images.erase(5);
  Run();
  EXPECT_EQ(names(), 4u);
}

TEST_F(UndistortImagesTest, ABrokenPhotographIsNamedAndLeftOut) {
  WriteBitmap(job_.image_path + "/image1.png", Bitmap{100, 75, 1, std::vector<uint8_t>(7500)});
  fs::remove(job_.image_path + "/image2.png");
  std::ofstream(job_.image_path + "/image3.png") << "no image";
  const UndistortReport report = Run();
  EXPECT_EQ(report.num_written, 2);
  ASSERT_EQ(report.failed.size(), 3u);
  EXPECT_EQ(report.failed.at("image1.png"), "is 100 x 75 pixels, its camera 200 x 150");
  const Reconstruction model = ReadColmapModel(Dense("sparse"));
  EXPECT_EQ(model.images.size(), 2u);
  CheckConsistency(model);
  EXPECT_EQ(ReadFile(Dense("stereo/fusion.cfg")), "more/image4.png\nimage5.png\n");
}

// A size that no photograph has costs no time.
TEST_F(UndistortImagesTest, ACameraThatIsTooLargeIsNamed) {
  for (auto& [id, camera] : model_.cameras) camera.width = std::numeric_limits<int>::max();
  const UndistortReport report = Run();
  EXPECT_EQ(report.num_written, 0);
  ASSERT_EQ(report.failed.size(), 5u);
  EXPECT_THAT(report.failed.at("image1.png"),
              HasSubstr("is 200 x 150 pixels, its camera 2147483647"));
}

TEST_F(UndistortImagesTest, AFolderThatIsNotThereIsOneError) {
  job_.image_path = folder_ / "absent";
  EXPECT_THAT(ThrownMessage<IoError>([&] { Run(); }), HasSubstr("absent: no such folder"));
}

TEST_F(UndistortImagesTest, NothingOfOthersIsReplaced) {
  CreateFolders(Dense("images"));
  std::ofstream(Dense("images/image5.png")) << "mine";
  const auto message = [&] { return ThrownMessage<ConfigError>([&] { Run(); }); };
  EXPECT_NE(message().find("image5.png is not as cairn wrote it"), std::string::npos);
  EXPECT_FALSE(fs::exists(Dense("images/image1.png")));
  job_.overwrites = true;
  EXPECT_EQ(Run().num_written, 5);
}

// Images that are written among photographs would be taken for some.
TEST_F(UndistortImagesTest, NoImageIsWrittenAmongPhotographs) {
  CreateFolders(folder_ / "dense");
  fs::rename(folder_ / "photos", Dense("images"));
  fs::create_directory_symlink(Dense("images"), folder_ / "link");
  const auto photos = Files(folder_ / "dense");
  for (const DenseLayout layout : {DenseLayout::kColmap, DenseLayout::kGaussianSplatting}) {
    for (const std::string& path : {Dense("images"), folder_ / "link/", folder_ / "dense/."}) {
      job_ = {.image_path = path, .output_path = folder_ / "dense", .layout = layout};
      job_.overwrites = true;
      for (auto& [id, image] : model_.images) {
        // Names are relative to image_path; a photograph of a folder is renamed for splatting.
        const std::string name = (id == 4 ? "more/image" : "image") + std::to_string(id) + ".png";
        image.image.name = (path.ends_with(".") ? "images/" : "") + name;
      }
      EXPECT_THROW(Run(), ConfigError) << path;
    }
  }
  std::erase_if(model_.images, [](const auto& image) { return image.first != 4; });
  model_.points3D.clear();
  EXPECT_THROW(Run(), ConfigError);
  EXPECT_TRUE(Files(folder_ / "dense") == photos);
  job_.output_path = folder_ / "dense/splats";  // beside them is a place of its own
  EXPECT_EQ(Run().num_written, 1);
}

TEST_F(UndistortImagesTest, TheModelThatIsReadStays) {
  job_.layout = DenseLayout::kGaussianSplatting;
  WriteColmapModel(model_, Dense("sparse/0"));
  fs::create_directory_symlink(folder_ / "dense", folder_ / "link");
  for (const bool overwrites : {false, true}) {
    for (const std::string& path :
         {Dense("sparse/0"), Dense("sparse/"), folder_ / "link/sparse/0/"}) {
      job_.overwrites = overwrites;
      job_.model_path = path;
      EXPECT_NE(ThrownMessage<ConfigError>([&] {
                  Run();
                }).find(folder_ / "dense holds the model that is undistorted"),
                std::string::npos)
          << path;
    }
  }
  EXPECT_FALSE(fs::exists(Dense("images")));
  EXPECT_EQ(ReadColmapModel(Dense("sparse/0")).images.size(), 5u);
  job_.output_path = folder_ / "dense/sparse/0/dense";
  EXPECT_EQ(Run().num_written, 5);
}

TEST_F(UndistortImagesTest, NamesThatLeaveTheFolderAreRefused) {
  model_.images.at(1).image.name = "../image1.png";
  EXPECT_THROW(Run(), IoError);
}

}  // namespace
}  // namespace cairn
