// The presets in configs/ hold known keys and valid values.
#include <filesystem>

#include "integration/scene_files.h"
#include "support/test.h"

namespace cairn {
namespace {

TEST(Configs, EveryPresetIsAccepted) {
  const SceneFiles scene;
  int num_presets = 0;
  for (const auto& entry : std::filesystem::directory_iterator(CAIRN_SOURCE_DIR "/configs")) {
    const std::string name = entry.path().filename();
    const std::string database = scene / (name + ".db");
    // Enough to read the options: they are checked before anything is computed.
    const ProgramResult result = RunProgram(
        "build_view_graph",
        {"--config", entry.path(), "--image_path", scene / "nowhere", "--database_path", database});
    EXPECT_EQ(result.exit_code, 3) << name << ": " << result.output;
    EXPECT_NE(result.output.find("nowhere: no such folder"), std::string::npos) << result.output;
    ++num_presets;
  }
  EXPECT_GE(num_presets, 3);
}

}  // namespace
}  // namespace cairn
