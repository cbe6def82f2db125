// The presets in configs/ hold known keys and valid values, and default.toml holds the defaults.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "cairn/base/file.h"
#include "integration/scene_files.h"

namespace cairn {
namespace {

using testing::ProgramResult;
using testing::SceneFiles;

TEST(Configs, EveryPresetIsAccepted) {
  const SceneFiles scene;
  int num_presets = 0;
  for (const auto& entry : std::filesystem::directory_iterator(CAIRN_SOURCE_DIR "/configs")) {
    const std::string name = entry.path().filename();
    const std::string database = scene / (name + ".db");
    // Enough to read the options: they are checked before anything is computed.
    const ProgramResult result = testing::RunProgram(
        "build_view_graph",
        {"--config", entry.path(), "--image_path", scene / "nowhere", "--database_path", database});
    EXPECT_EQ(result.exit_code, 3) << name << ": " << result.output;
    EXPECT_NE(result.output.find("nowhere: no such folder"), std::string::npos) << result.output;
    ++num_presets;
  }
  EXPECT_GE(num_presets, 3);
}

// When an option is added or a default changed: CAIRN_UPDATE_CONFIGS=1 ctest --test-dir build -R
// Configs
TEST(Configs, DefaultTomlHoldsTheDefaults) {
  const SceneFiles scene;
  std::filesystem::create_directory(scene / "one");
  std::filesystem::copy(scene / "images/image00001.jpg", scene / "one");
  const std::string database = scene / "new.db";
  const ProgramResult result = testing::RunProgram(
      "build_view_graph",
      {"--image_path", scene / "one", "--database_path", database, "--stop_after", "features"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const std::string effective = ReadFile(database + ".effective.toml");
  const std::string expected =
      "# build_view_graph: every option of its modules, at its default.\n" +
      effective.substr(effective.find("[features]"));
  const std::string path = CAIRN_SOURCE_DIR "/configs/default.toml";
  if (std::getenv("CAIRN_UPDATE_CONFIGS") != nullptr) WriteFileAtomically(path, expected);
  EXPECT_EQ(ReadFile(path), expected);
}

}  // namespace
}  // namespace cairn
