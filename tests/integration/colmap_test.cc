// Debian's colmap 3.8 reads what we write. Skipped where it is not installed.
#include <gtest/gtest.h>

#include <cstdlib>
#include <regex>

#include "cairn/io/colmap_model.h"
#include "integration/scene_files.h"

namespace cairn {
namespace {

using testing::ProgramResult;
using testing::RunExecutable;
using testing::RunProgram;
using testing::SceneFiles;

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

TEST_F(Colmap, MapperRunsOnOurDatabase) {
  const SceneFiles scene;
  std::filesystem::create_directory(scene / "mapper");
  const ProgramResult result =
      RunColmap({"mapper", "--database_path", scene.database(), "--image_path", scene.images(),
                 "--output_path", scene / "mapper", "--Mapper.multiple_models", "0"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(ReadColmapModel(scene / "mapper/0").images.size(), 8u);
}

}  // namespace
}  // namespace cairn
