// The files of a reconstruction, and what it takes from photographs.
#include <sys/resource.h>

#include <csignal>
#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/image/bitmap.h"
#include "cairn/io/colmap_model.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "support/thrown_message.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

class OutputTest : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_ / "images"); }
  const TempFolder folder_;
};

TEST_F(OutputTest, WritesAndReplacesAllFiles) {
  const SyntheticScene scene = MakeScene(SmallScene(), 10);
  ReconstructResult result = Reconstruct(MakeDatabase(scene));
  result.models.push_back(result.models.front());
  result.confidences.push_back(result.confidences.front());
  result.models[1].images.at(scene.images[8].image_id).image.name = "a, b.jpg";
  const std::string output = folder_ / "new/out";
  WriteReconstructResult(result, output, "# options\n");
  for (const char* name :
       {"sparse/0/cameras.bin", "sparse/1/points3D.bin", "bundle.out", "list.txt", "points.ply",
        "confidence.csv", "view_graph.json", "view_graph.dot", "report.json", "effective.toml"}) {
    EXPECT_TRUE(std::filesystem::exists(std::filesystem::path(output) / name)) << name;
  }
  const std::string confidence = ReadFile(output + "/confidence.csv");
  EXPECT_EQ(std::count(confidence.begin(), confidence.end(), '\n'), 21);
  EXPECT_THAT(confidence, HasSubstr(scene.images[9].name + ",1,6,"));
  EXPECT_THAT(confidence, HasSubstr("\n\"a, b.jpg\",1,"));
  const Reconstruction read = ReadColmapModel(output + "/sparse/0");
  EXPECT_EQ(read.images.size(), result.models[0].images.size());
  EXPECT_EQ(read.points3D.size(), result.models[0].points3D.size());

  result.models.pop_back();
  result.confidences.pop_back();
  WriteReconstructResult(result, output, "# options\n");
  EXPECT_FALSE(std::filesystem::exists(output + "/sparse/1"));

  // A failure leaves the older model alone, with its report.
  result.models.clear();
  result.report.failure = "stage: reason; advice";
  WriteReconstructResult(result, output, "# options\n");
  EXPECT_TRUE(std::filesystem::exists(output + "/sparse/0/images.bin"));
  EXPECT_THAT(ReadFile(output + "/report.json"), Not(HasSubstr("stage: reason; advice")));
  EXPECT_THAT(ReadFile(output + "/failed/report.json"), HasSubstr("stage: reason; advice"));
  EXPECT_FALSE(std::filesystem::exists(output + "/failed/sparse"));

  // So do models of a run that was stopped.
  result = Reconstruct(MakeDatabase(scene));
  result.report.failure = "stopped by the user";
  WriteReconstructResult(result, output, "# options\n");
  EXPECT_TRUE(std::filesystem::exists(output + "/sparse/0/images.bin"));
  EXPECT_THAT(ReadFile(output + "/report.json"), Not(HasSubstr("stopped by the user")));
  EXPECT_TRUE(std::filesystem::exists(output + "/failed/sparse/0/images.bin"));

  // And another program's model, even where it may be replaced.
  const std::string others = output + "/others";
  CreateFolders(others + "/sparse/0");
  WriteFileAtomically(others + "/sparse/0/images.bin", "COLMAP's");
  WriteReconstructResult(result, others, "# options\n", true);
  EXPECT_EQ(ReadFile(others + "/sparse/0/images.bin"), "COLMAP's");
  EXPECT_TRUE(std::filesystem::exists(others + "/failed/report.json"));
}

// The page comes last: what it lacks room for is not the models'.
TEST_F(OutputTest, APageThatCannotBeWrittenDoesNotLoseTheModels) {
  ReconstructResult result = Reconstruct(MakeDatabase(MakeScene(SmallScene(), 10)));
  constexpr size_t kRoom = 1 << 20;
  result.page = std::string(2 * kRoom, ' ');
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{kRoom, before.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  TestMonitor monitor;
  EXPECT_NO_THROW(
      WriteReconstructResult(result, folder_ / "out", "# options\n", false, {.monitor = monitor}));
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(monitor.warnings(),
              Contains(HasSubstr("report.html cannot be written: File too large")));
  EXPECT_TRUE(result.page.empty());
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out/report.json"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/report.html"));
  EXPECT_EQ(ReadColmapModel(folder_ / "out/sparse/0").images.size(), 10u);
}

TEST_F(OutputTest, ModelsOfOtherProgramsAreNotReplaced) {
  const std::string output = folder_.path();
  EXPECT_NO_THROW(CheckReconstructOutput(output + "/absent"));
  std::filesystem::create_directories(folder_ / "sparse/0");
  EXPECT_NO_THROW(CheckReconstructOutput(output));  // photographs alone, and empty folders
  WriteFileAtomically(output + "/sparse/0/cameras.bin", "COLMAP's");
  EXPECT_NO_THROW(CheckReconstructOutput(output, true));
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { CheckReconstructOutput(output); }),
              AllOf(HasSubstr(output + "/sparse/0/cameras.bin is not as cairn wrote it"),
                    HasSubstr("--overwrite")));
  // A run that was interrupted, or failed before it wrote anything, makes it nobody else's.
  WriteFileAtomically(output + "/effective.toml", "# global_sfm reconstruct, cairn 0.1.0\n");
  EXPECT_THROW(CheckReconstructOutput(output), ConfigError);
  EXPECT_EQ(ReadFile(output + "/sparse/0/cameras.bin"), "COLMAP's");
}

TEST_F(OutputTest, AFolderOfPhotographsThatIsNotThereEndsTheRunBeforeAnyWork) {
  const Database database = MakeDatabase(MakeScene(SmallScene(), 10));
  EXPECT_THAT(ThrownMessage<IoError>([&] { Reconstruct(database, folder_ / "absent"); }),
              HasSubstr("absent: no such folder"));
}

// Red grows to the right, green downwards.
Bitmap Gradient(int width, int height) {
  Bitmap bitmap{width, height, 3, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      bitmap.data.push_back(static_cast<uint8_t>(255 * x / width));
      bitmap.data.push_back(static_cast<uint8_t>(255 * y / height));
      bitmap.data.push_back(30);
    }
  }
  return bitmap;
}

// The photographs are four times as large as what was matched.
TEST_F(OutputTest, ColorsComeFromThePhotographs) {
  SyntheticScene scene = MakeScene(SmallScene(), 11);
  for (const Image& image : scene.images) {
    if (image.image_id == 3) continue;  // one photograph is missing
    const Camera& camera = scene.cameras.at(image.camera_id);
    const int width = (image.image_id == 4 ? 3 : 4) * camera.width;  // one is another photograph
    WriteBitmap(folder_ / ("images/" + image.name), Gradient(width, 4 * camera.height), 100);
  }
  const ReconstructResult result =
      Reconstruct(MakeDatabase(scene), folder_ / "images", {}, kOneThread);
  ASSERT_TRUE(result.report.Succeeded());
  const Reconstruction& model = result.models[0];
  for (const auto& [id, point] : model.points3D) {
    Eigen::Vector2d sum(0, 0);
    int num_views = 0;
    for (const TrackElement& element : point.track) {
      if (element.image_id == 3 || element.image_id == 4) continue;
      const RegisteredImage& image = model.images.at(element.image_id);
      const Camera& camera = model.CameraOf(image);
      sum += image.points2D[element.point2D].cwiseQuotient(
          Eigen::Vector2d(camera.width, camera.height));
      ++num_views;
    }
    EXPECT_NEAR(point.color[0], 255 * sum.x() / num_views, 3);
    EXPECT_NEAR(point.color[1], 255 * sum.y() / num_views, 3);
  }
  const StageReport* stage = FindStage(result.report, "colors");
  ASSERT_NE(stage, nullptr);
  EXPECT_EQ(Value(*stage, "images_read"), 8);
  EXPECT_EQ(stage->status, StageStatus::kWarning);
  ASSERT_EQ(result.report.warnings.size(), 1u);
  EXPECT_THAT(result.report.warnings[0].what, HasSubstr("photographs gave no colors"));
}

}  // namespace
}  // namespace cairn
