// The commands that README gives for one's own photographs, as they stand there.
#include <filesystem>
#include <regex>
#include <sstream>

#include "cairn/base/file.h"
#include "cairn/io/colmap_model.h"
#include "integration/scene_files.h"
#include "support/test.h"

namespace cairn {
namespace {

// The lines of README's section on one's own photographs that run our programs.
std::vector<std::string> Commands() {
  std::istringstream text(ReadFile(std::filesystem::path(CAIRN_SOURCE_DIR) / "README.md"));
  std::vector<std::string> commands;
  bool is_in_section = false;
  for (std::string line; std::getline(text, line);) {
    if (line.starts_with("## ")) is_in_section = line == "## Your own photographs";
    if (is_in_section && line.starts_with("build/bin/")) commands.push_back(line);
  }
  return commands;
}

// The page without the digits of standard deviations.
std::string WithoutSigmas(const std::string& page) {
  return std::regex_replace(page, std::regex("_sigma(_deg)?\":[0-9][0-9.e-]*"), "");
}

TEST(Readme, ThreeCommandsLeadFromPhotographsToSplatsAndAReport) {
  namespace fs = std::filesystem;
  const SceneFiles scene;
  fs::create_directory_symlink(scene.images(), scene / "photos");
  fs::create_directory_symlink(CAIRN_BINARY_DIR, scene / "build");
  fs::remove(scene.database());
  std::vector<std::string> commands = Commands();
  ASSERT_EQ(commands.size(), 3u);
  commands.push_back("build/bin/global_sfm report --model_path model --output_path again.html");
  for (const std::string& command : commands) {
    const ProgramResult result =
        RunExecutable("sh", {"-c", "cd '" + (scene / "") + "' && " + command});
    ASSERT_EQ(result.exit_code, 0) << command << "\n" << result.output;
  }
  const std::string page = ReadFile(scene / "model/report.html");
  EXPECT_TRUE(page.starts_with("<!doctype html>"));
  // The page of the run's folder is that of the run, but for the digits that its table keeps.
  EXPECT_LT(WithoutSigmas(page).size(), page.size());
  EXPECT_TRUE(WithoutSigmas(page) == WithoutSigmas(ReadFile(scene / "again.html")));
  const Reconstruction model = ReadColmapModel(scene / "splats/sparse/0");
  EXPECT_EQ(model.images.size(), 8u);
  EXPECT_GT(model.points3D.size(), 100u);
  for (const auto& [id, image] : model.images) {
    EXPECT_EQ(model.CameraOf(image).model, CameraModel::kPinhole);
    EXPECT_TRUE(fs::is_regular_file(scene / ("splats/images/" + image.image.name)));
  }
}

}  // namespace
}  // namespace cairn
