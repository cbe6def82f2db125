// Agreement with COLMAP's own program. Skipped where `colmap` is not installed.
#include <cstdlib>
#include <filesystem>

#include "cairn/base/file.h"
#include "cairn/io/bundler.h"
#include "cairn/io/colmap_model.h"
#include "random_reconstruction.h"
#include "support/check_consistency.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

bool HasColmap() { return std::system("command -v colmap > /dev/null 2>&1") == 0; }

// Runs `colmap <arguments>`; what it prints goes to `output`.
int Colmap(const std::string& arguments, const std::string& output) {
  const std::string command =
      "QT_QPA_PLATFORM=offscreen colmap " + arguments + " > " + output + " 2>&1";
  return std::system(command.c_str());
}

// COLMAP's text files cannot hold blanks in names, and it keeps one keypoint an image and point.
Reconstruction ColmapReconstruction(bool all_camera_models) {
  Reconstruction r = RandomReconstruction(
      11, {.num_images = 8, .num_points = 300, .all_camera_models = all_camera_models});
  for (auto& [id, image] : r.images) image.image.name = "image" + std::to_string(id) + ".jpg";
  return r;
}

std::string Line(const std::string& text, const std::string& key) {
  const size_t begin = text.find(key);
  if (begin == std::string::npos) return "";
  return text.substr(begin + key.size(), text.find('\n', begin) - begin - key.size());
}

TEST(Colmap, ModelAnalyzerAgreesOnCountsAndErrors) {
  if (!HasColmap()) GTEST_SKIP() << "colmap is not installed";
  const TempFolder folder;
  const Reconstruction r = ColmapReconstruction(true);
  for (const ColmapModelFormat format : {ColmapModelFormat::kBinary, ColmapModelFormat::kText}) {
    const std::string model = folder / (format == ColmapModelFormat::kBinary ? "bin" : "txt");
    WriteColmapModel(r, model, format);
    ASSERT_EQ(Colmap("model_analyzer --path " + model, folder / "log"), 0)
        << ReadFile(folder / "log");
    const std::string log = ReadFile(folder / "log");
    EXPECT_EQ(Line(log, "Cameras: "), "8");
    EXPECT_EQ(Line(log, "Images: "), "8");
    EXPECT_EQ(Line(log, "Registered images: "), "8");
    EXPECT_EQ(Line(log, "Points: "), "300");
    EXPECT_EQ(Line(log, "Observations: "), std::to_string(r.NumObservations()));
    EXPECT_NEAR(std::stod(Line(log, "Mean track length: ")), r.MeanTrackLength(), 1e-5);
    EXPECT_NEAR(std::stod(Line(log, "Mean reprojection error: ")), r.MeanReprojectionErrorPx(),
                0.02);
  }
}

TEST(Colmap, ModelConverterGivesTheSameModel) {
  if (!HasColmap()) GTEST_SKIP() << "colmap is not installed";
  const TempFolder folder;
  const Reconstruction r = ColmapReconstruction(true);
  WriteColmapModel(r, folder / "bin");
  for (const char* name : {"txt", "bin2"}) CreateFolders(folder / name);
  ASSERT_EQ(Colmap("model_converter --input_path " + (folder / "bin") + " --output_path " +
                       (folder / "txt") + " --output_type TXT",
                   folder / "log"),
            0)
      << ReadFile(folder / "log");
  ASSERT_EQ(Colmap("model_converter --input_path " + (folder / "txt") + " --output_path " +
                       (folder / "bin2") + " --output_type BIN",
                   folder / "log"),
            0)
      << ReadFile(folder / "log");
  for (const char* name : {"txt", "bin2"}) {
    const Reconstruction read = ReadColmapModel(folder / name);
    CheckConsistency(read);
    ASSERT_EQ(read.images.size(), r.images.size());
    ASSERT_EQ(read.points3D.size(), r.points3D.size());
    for (const auto& [id, camera] : r.cameras) EXPECT_EQ(read.cameras.at(id).params, camera.params);
    for (const auto& [id, image] : r.images) {
      const RegisteredImage& other = read.images.at(id);
      EXPECT_EQ(other.image.name, image.image.name);
      EXPECT_LT(AngleBetween(other.cam_from_world.rotation, image.cam_from_world.rotation), 1e-14);
      EXPECT_EQ(other.cam_from_world.translation, image.cam_from_world.translation);
      EXPECT_EQ(other.points2D, image.points2D);
      EXPECT_EQ(other.point3D_ids, image.point3D_ids);
    }
    for (const auto& [id, point] : r.points3D) {
      EXPECT_EQ(read.points3D.at(id).xyz, point.xyz);
      EXPECT_EQ(read.points3D.at(id).color, point.color);
      EXPECT_EQ(read.points3D.at(id).track, point.track);
    }
  }
}

TEST(Colmap, BundlerFilesAgree) {
  if (!HasColmap()) GTEST_SKIP() << "colmap is not installed";
  const TempFolder folder;
  const Reconstruction r = ColmapReconstruction(false);
  WriteColmapModel(r, folder / "bin");
  ASSERT_EQ(Colmap("model_converter --input_path " + (folder / "bin") + " --output_path " +
                       (folder / "colmap") + " --output_type Bundler",
                   folder / "log"),
            0)
      << ReadFile(folder / "log");
  WriteBundler(r, folder / "ours.out", folder / "ours.txt");
  const Reconstruction theirs =
      ReadBundler(folder / "colmap.bundle.out", folder / "colmap.list.txt");
  const Reconstruction ours = ReadBundler(folder / "ours.out", folder / "ours.txt");
  ASSERT_EQ(theirs.images.size(), ours.images.size());
  EXPECT_EQ(theirs.NumObservations(), ours.NumObservations());
  EXPECT_NEAR(theirs.MeanReprojectionErrorPx(), ours.MeanReprojectionErrorPx(), 1e-3);
  for (const auto& [id, image] : ours.images) {
    const std::string& name = image.image.name;
    const auto same = std::find_if(theirs.images.begin(), theirs.images.end(),
                                   [&](const auto& i) { return i.second.image.name == name; });
    ASSERT_NE(same, theirs.images.end());
    EXPECT_LT((same->second.cam_from_world.Center() - image.cam_from_world.Center()).norm(), 1e-6);
    EXPECT_LT(AngleBetween(same->second.cam_from_world.rotation, image.cam_from_world.rotation),
              1e-6);
  }
}

}  // namespace
}  // namespace cairn
