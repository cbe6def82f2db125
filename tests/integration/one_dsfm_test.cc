// 1DSfM data sets through the programs: a scene written as one and read back, with and without its
// photographs, and what is broken in its files.
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "cairn/io/colmap_model.h"
#include "integration/scene_files.h"
#include "support/shared_data.h"
#include "support/test.h"

namespace cairn {
namespace {

// Runs a program that has to succeed.
void Succeed(const std::string& program, const std::vector<std::string>& arguments) {
  const ProgramResult result = RunProgram(program, arguments);
  ASSERT_EQ(result.exit_code, 0) << result.output;
}

nlohmann::json Evaluate(const std::string& model, const std::string& reference,
                        const std::string& json_path) {
  Succeed("global_sfm", {"evaluate", "--model_path", model, "--reference_path", reference,
                         "--output_path", json_path});
  return nlohmann::json::parse(ReadFile(json_path));
}

nlohmann::json StageOf(const std::string& report_path, const std::string& name) {
  const auto report = nlohmann::json::parse(ReadFile(report_path));
  for (const auto& stage : report["stages"]) {
    if (stage["name"] == name) return stage["values"];
  }
  return nullptr;
}

class OneDsfmFolder : public ::testing::Test {
 protected:
  OneDsfmFolder() {
    Succeed("global_sfm", {"reconstruct", "--database_path", scene_.database(), "--output_path",
                           scene_ / "direct"});
    Succeed("global_sfm", {"export", "--output_type", "1dsfm", "--model_path",
                           scene_ / "direct/sparse/0", "--database_path", scene_.database(),
                           "--image_path", scene_.images(), "--output_path", folder_});
  }

  // From the data set as it is now, to a model in scene_ / name.
  void ReadBack(const std::string& name) {
    Succeed("build_view_graph", {"--dataset_path", folder_, "--database_path",
                                 scene_ / name + ".db", "--features.max_num_features", "800"});
    Succeed("global_sfm", {"reconstruct", "--database_path", scene_ / name + ".db", "--output_path",
                           scene_ / name});
  }

  const SceneFiles scene_;
  const std::string folder_ = scene_ / "dataset";
};

TEST_F(OneDsfmFolder, IsReadBackWithItsPhotographs) {
  ReadBack("back");
  const auto direct =
      Evaluate(scene_ / "direct/sparse/0", SceneFiles::truth(), scene_ / "direct.json");
  const auto back = Evaluate(scene_ / "back/sparse/0", SceneFiles::truth(), scene_ / "back.json");
  EXPECT_EQ(back["registered"], 8);
  EXPECT_GT(back["auc@10"], double{direct["auc@10"]} - 10);  // tiny photographs
  const auto to_reference =
      Evaluate(scene_ / "back/sparse/0", folder_ + "/gt_bundle.out", scene_ / "reference.json");
  EXPECT_EQ(to_reference["registered"], 8);
  EXPECT_GT(to_reference["auc@10"], 85.0);
}

TEST_F(OneDsfmFolder, GivesAModelFromItsTracksWithoutPhotographs) {
  std::filesystem::remove_all(folder_ + "/images");
  ReadBack("tracks");
  EXPECT_GT(ReadColmapModel(scene_ / "tracks/sparse/0").points3D.size(), 100u);
  const auto figures =
      Evaluate(scene_ / "tracks/sparse/0", SceneFiles::truth(), scene_ / "tracks.json");
  EXPECT_EQ(figures["registered"], 8);
  EXPECT_GT(figures["auc@10"], 75.0);  // a camera an image, where the scene has two
}

TEST_F(OneDsfmFolder, GivesCamerasFromItsRelativePosesAlone) {
  for (const char* name : {"/images", "/coords.txt", "/tracks.txt"}) {
    std::filesystem::remove_all(folder_ + name);
  }
  ReadBack("poses");
  const Reconstruction model = ReadColmapModel(scene_ / "poses/sparse/0");
  EXPECT_GE(model.images.size(), 7u);
  EXPECT_TRUE(model.points3D.empty());
  EXPECT_GT(
      Evaluate(scene_ / "poses/sparse/0", SceneFiles::truth(), scene_ / "poses.json")["auc@10"],
      60.0);
  EXPECT_GT(StageOf(scene_ / "poses/report.json", "agreement")["rotation_within_5_deg"], 0.9);
  // What is broken is named with its line.
  const std::string edges = ReadFile(folder_ + "/EGs.txt");
  const auto line = 1 + std::ranges::count(edges, '\n');
  WriteFileAtomically(folder_ + "/EGs.txt", edges + "0 77 1 0 0 0 1 0 0 0 1 0 0 1\n");
  const ProgramResult broken = RunProgram(
      "build_view_graph", {"--dataset_path", folder_, "--database_path", scene_ / "broken.db"});
  EXPECT_EQ(broken.exit_code, 3);
  EXPECT_THAT(broken.output, HasSubstr("EGs.txt:" + std::to_string(line) +
                                       ": image index 77 is not in list.txt, which has 10 images"));
}

// What the issue asks of a real scene: at most 2 below the direct reconstruction at 1 degree.
TEST(OneDsfmData, FountainIsReadBackAsAccurately) {
  const std::string scene = SharedDataPath("strecha/fountain-P11");
  if (!std::filesystem::exists(scene)) GTEST_SKIP() << scene << " is absent";
  std::string intrinsics = ReadFile(scene + "/pinhole_fx_fy_cx_cy.txt");
  intrinsics.erase(intrinsics.find_last_not_of(" \n") + 1);
  std::replace(intrinsics.begin(), intrinsics.end(), ' ', ',');
  const TempFolder out;
  const auto reconstruct = [&](const std::string& name, std::vector<std::string> inputs) {
    inputs.insert(inputs.end(), {"--database_path", out / name + ".db", "--features.type", "sift"});
    Succeed("build_view_graph", inputs);
    Succeed("global_sfm",
            {"reconstruct", "--database_path", out / name + ".db", "--output_path", out / name});
    return Evaluate(out / name + "/sparse/0", scene + "/gt", out / name + ".json");
  };
  const auto direct =
      reconstruct("direct", {"--image_path", scene + "/images", "--camera_model", "PINHOLE",
                             "--single_camera", "--camera_params", intrinsics});
  Succeed("global_sfm", {"export", "--output_type", "1dsfm", "--model_path",
                         out / "direct/sparse/0", "--database_path", out / "direct.db",
                         "--image_path", scene + "/images", "--output_path", out / "set"});
  const auto back = reconstruct("back", {"--dataset_path", out / "set"});
  EXPECT_EQ(direct["registered"], 11);
  EXPECT_EQ(back["registered"], 11);
  EXPECT_GT(direct["auc@1"], 93.0);
  EXPECT_GT(back["auc@1"], double{direct["auc@1"]} - 2.0);
}

// The real relative poses of Madrid_Metropolis, of which three loops of four do not close.
TEST(OneDsfmData, MadridMetropolisFromItsRelativePosesAlone) {
  const std::string folder = SharedDataPath("1dsfm/Madrid_Metropolis");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const TempFolder out;
  Succeed("build_view_graph", {"--dataset_path", folder, "--database_path", out / "madrid.db"});
  Succeed("global_sfm",
          {"reconstruct", "--database_path", out / "madrid.db", "--output_path", out / "madrid"});
  const std::string report = out / "madrid/report.json";
  EXPECT_EQ(StageOf(report, "view_graph")["edges_in"], 23784);
  EXPECT_GT(StageOf(report, "rotation_averaging")["images_out"], 380);
  EXPECT_LT(StageOf(report, "rotation_averaging")["median_residual_deg"], 4.0);
  EXPECT_GT(StageOf(report, "translation_averaging")["images_out"], 300);
  EXPECT_LT(StageOf(report, "translation_averaging")["median_edge_error_deg"], 5.0);
  EXPECT_GT(StageOf(report, "agreement")["rotation_within_20_deg"], 0.5);
  EXPECT_GT(ReadColmapModel(out / "madrid/sparse/0").images.size(), 300u);
}

}  // namespace
}  // namespace cairn
