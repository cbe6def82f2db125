#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "support/run_program.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {

// A copy of the rendered scene (8 images and 2 distractors) and of its database, which a test may
// change: images/, depth/, scene.db. truth() is the original.
class SceneFiles {
 public:
  SceneFiles() {
    namespace fs = std::filesystem;
    for (const char* part : {"images", "depth"}) {
      fs::copy(fs::path(CAIRN_SCENE_DIR) / part, folder_ / part);
    }
    fs::copy(CAIRN_SCENE_DIR "/scene.db", database());
  }
  std::string operator/(const std::string& name) const { return folder_ / name; }
  std::string images() const { return folder_ / "images"; }
  std::string database() const { return folder_ / "scene.db"; }
  static std::string truth() { return CAIRN_SCENE_DIR "/truth"; }

  // build_view_graph with the options that the database was made with, and others.
  ProgramResult BuildViewGraph(const std::string& database, std::vector<std::string> others = {},
                               double kill_after_seconds = 0) const {
    std::vector<std::string> arguments = {"--image_path",
                                          images(),
                                          "--depth_path",
                                          folder_ / "depth",
                                          "--database_path",
                                          database,
                                          "--features.max_num_features",
                                          "800"};
    arguments.insert(arguments.end(), others.begin(), others.end());
    return RunProgram("build_view_graph", arguments, kill_after_seconds);
  }
  // Writes the true model as a Bundler file and returns its path; list.txt is beside it.
  std::string ExportBundler() const {
    const ProgramResult result =
        RunProgram("global_sfm", {"export", "--model_path", truth(), "--output_path",
                                  folder_ / "bundler", "--output_type", "bundler"});
    EXPECT_EQ(result.exit_code, 0) << result.output;
    return folder_ / "bundler/bundle.out";
  }

 private:
  TempFolder folder_;
};

// The lines of a program's output that contain `text`.
inline std::vector<std::string> LinesWith(const std::string& output, const std::string& text) {
  std::vector<std::string> lines;
  for (size_t begin = 0; begin < output.size();) {
    const size_t end = std::min(output.find('\n', begin), output.size());
    const std::string line = output.substr(begin, end - begin);
    if (line.find(text) != std::string::npos) lines.push_back(line);
    begin = end + 1;
  }
  return lines;
}

}  // namespace cairn
