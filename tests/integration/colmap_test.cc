// Debian's colmap 3.8 reads what we write. Skipped where it is not installed.
#include <cstdlib>
#include <regex>
#include <set>

#include "cairn/base/file.h"
#include "cairn/io/colmap_model.h"
#include "integration/scene_files.h"
#include "support/test.h"

namespace cairn {
namespace {

ProgramResult RunColmap(const std::vector<std::string>& arguments) {
  setenv("QT_QPA_PLATFORM", "offscreen", 1);
  return RunExecutable("colmap", arguments);
}

class Colmap : public ::testing::Test {
 protected:
  void SetUp() override {
    if (RunColmap({"help"}).exit_code == 127) GTEST_SKIP() << "colmap is not installed";
  }
};

// The number after `label` in the analyzer's output.
double Figure(const std::string& output, const std::string& label) {
  std::smatch match;
  if (!std::regex_search(output, match, std::regex(label + ": ([0-9.]+)"))) {
    ADD_FAILURE() << label << " is not in " << output;
    return 0;
  }
  return std::stod(match[1]);
}

TEST_F(Colmap, ModelAnalyzerAgreesWithUs) {
  const SceneFiles scene;
  ASSERT_EQ(
      RunProgram("global_sfm", {"reconstruct", "--database_path", scene.database(), "--image_path",
                                scene.images(), "--output_path", scene / "out"})
          .exit_code,
      0);
  const Reconstruction model = ReadColmapModel(scene / "out/sparse/0");
  const ProgramResult result = RunColmap({"model_analyzer", "--path", scene / "out/sparse/0"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(Figure(result.output, "Registered images"), model.images.size());
  EXPECT_EQ(Figure(result.output, "Points"), model.points3D.size());
  EXPECT_EQ(Figure(result.output, "Observations"), model.NumObservations());
  EXPECT_NEAR(Figure(result.output, "Mean reprojection error"), model.MeanReprojectionErrorPx(),
              1e-3);
}

// Files and folders below a folder, without hidden ones.
std::set<std::string> Below(const std::string& folder) {
  namespace fs = std::filesystem;
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = fs::relative(entry.path(), folder).string();
    if (!name.starts_with('.')) names.insert(name);
  }
  return names;
}

// Of a camera with distortion: the layout is that of COLMAP's image_undistorter, the camera differs
// by the half pixel at which it looks at the border, and its programs open the model.
TEST_F(Colmap, OpensUndistortedWorkspaces) {
  const SceneFiles scene;
  Reconstruction model = ReadColmapModel(SceneFiles::truth());
  for (auto& [id, camera] : model.cameras) {
    camera.model = CameraModel::kOpenCVFisheye;
    camera.params = {camera.FocalX(),
                     camera.FocalY(),
                     0.5 * camera.width + 5,
                     0.5 * camera.height,
                     0.02,
                     -0.01,
                     0.0,
                     0.0};
  }
  WriteColmapModel(model, scene / "fisheye");
  const std::vector<std::string> images = {"--image_path", scene.images(), "--output_path"};
  std::vector<std::string> ours = {"undistort", "--model_path", scene / "fisheye"},
                           theirs = {"image_undistorter", "--input_path", scene / "fisheye"};
  for (std::vector<std::string>* arguments : {&ours, &theirs}) {
    arguments->insert(arguments->end(), images.begin(), images.end());
  }
  ours.push_back(scene / "ours");
  theirs.push_back(scene / "theirs");
  std::filesystem::create_directory(scene / "theirs");
  const ProgramResult result = RunProgram("global_sfm", ours);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  ASSERT_EQ(RunColmap(theirs).exit_code, 0);
  std::set<std::string> expected = Below(scene / "theirs");
  for (const char* kind : {"geometric", "photometric"}) {
    expected.erase(std::string("run-colmap-") + kind + ".sh");
  }
  expected.insert("effective.toml");
  EXPECT_EQ(Below(scene / "ours"), expected);
  const auto text = [&](const std::string& name) { return ReadFile(scene / name); };
  EXPECT_EQ(text("ours/stereo/patch-match.cfg"), text("theirs/stereo/patch-match.cfg"));
  EXPECT_EQ(text("ours/stereo/fusion.cfg"), text("theirs/stereo/fusion.cfg"));
  const Reconstruction written = ReadColmapModel(scene / "theirs/sparse");
  for (const auto& [id, camera] : ReadColmapModel(scene / "ours/sparse").cameras) {
    EXPECT_NEAR(camera.width, written.cameras.at(id).width, 2);
    EXPECT_NEAR(camera.height, written.cameras.at(id).height, 2);
    EXPECT_EQ(camera.FocalX(), written.cameras.at(id).FocalX());
  }
  EXPECT_EQ(RunColmap({"model_analyzer", "--path", scene / "ours/sparse"}).exit_code, 0);
  std::filesystem::create_directory(scene / "adjusted");
  EXPECT_EQ(RunColmap({"bundle_adjuster", "--input_path", scene / "ours/sparse", "--output_path",
                       scene / "adjusted"})
                .exit_code,
            0);
}

TEST_F(Colmap, MapperRunsOnOurDatabase) {
  const SceneFiles scene;
  std::filesystem::create_directory(scene / "mapper");
  const ProgramResult result =
      RunColmap({"mapper", "--database_path", scene.database(), "--image_path", scene.images(),
                 "--output_path", scene / "mapper"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(ReadColmapModel(scene / "mapper/0").images.size(), 8u);
}

}  // namespace
}  // namespace cairn
