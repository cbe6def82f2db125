#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "cairn/image/exif.h"
#include "cairn/pipeline/stages.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/test_photos.h"

namespace cairn {

// A folder of photographs, and a database that takes them in.
class ImportPhotosTest : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(images_); }

  void AddPhoto(const std::string& name, int width = 64, int height = 48) {
    std::filesystem::create_directories(std::filesystem::path(images_ + "/" + name).parent_path());
    WriteBitmap(images_ + "/" + name, WallPhoto(width, height, num_photos_++));
  }
  void AddFile(const std::string& name, const std::string& content) {
    std::ofstream(images_ + "/" + name, std::ios::binary) << content;
  }
  // As another program does: image 7 of camera 5.
  void AddForeignImage(const std::string& name) {
    database_.WriteCamera(Camera::FromFocal(5, CameraModel::kOpenCV, 99, 64, 48));
    database_.WriteImage({7, name, 5});
    database_.WriteKeypoints(7, std::vector<Keypoint>(3));
  }
  StageReport Import(const CameraOptions& options = {}, ProgressMonitor& monitor = NullMonitor()) {
    return ImportPhotos(database_, {images_}, options, {.num_threads = 2, .monitor = monitor});
  }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const Image& image : database_.ReadImages()) names.push_back(image.name);
    return names;
  }
  std::vector<camera_t> CameraIds() const {
    std::vector<camera_t> ids;
    for (const Image& image : database_.ReadImages()) ids.push_back(image.camera_id);
    return ids;
  }
  // A photograph of 64 x 48 pixels with EXIF.
  void AddPhotoOf(int focal_mm, const std::string& model, const std::string& name) {
    AddPhoto(name);
    WriteExif(images_ + "/" + name, {focal_mm, "Maker", model});
  }
  int num_photos_ = 0;
  TempFolder folder_;
  const std::string images_ = folder_ / "images";
  Database database_{":memory:"};
};

}  // namespace cairn
