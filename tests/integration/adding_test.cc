// Photographs that join a folder, or leave it, after the database and the model were made.
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "cairn/io/colmap_model.h"
#include "integration/scene_files.h"
#include "support/test.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

// The value of a stage in a report.json.
double ValueOf(const std::string& report, const std::string& stage, const std::string& key) {
  const nlohmann::json json = nlohmann::json::parse(ReadFile(report));
  for (const nlohmann::json& each : json["stages"]) {
    if (each["name"] == stage && each["values"].contains(key)) return each["values"][key];
  }
  return -1;
}

// A database and a model (out/) of the scene's photographs but the last two of the eight; these are
// in the folder "later".
class AddingTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::vector<std::string> names;
    for (const fs::directory_entry& entry : fs::directory_iterator(scene_.images())) {
      const std::string name = entry.path().filename();
      if (name.starts_with("image")) names.push_back(name);
    }
    std::sort(names.begin(), names.end());
    ASSERT_EQ(names.size(), 8u);
    later_ = {names[6], names[7]};
    fs::create_directories(scene_ / "later");
    for (const std::string& name : later_) {
      fs::rename(scene_.images() + "/" + name, scene_ / ("later/" + name));
    }
    fs::remove(scene_.database());
    const ProgramResult build = scene_.BuildViewGraph(scene_.database());
    ASSERT_EQ(build.exit_code, 0) << build.output;
    const ProgramResult run = Run("reconstruct", scene_ / "out");
    ASSERT_EQ(run.exit_code, 0) << run.output;
    ASSERT_EQ(ReadColmapModel(scene_ / "out/sparse/0").images.size(), 6u);
  }

  void Add() const {
    for (const std::string& name : later_) {
      fs::rename(scene_ / ("later/" + name), scene_.images() + "/" + name);
    }
    const ProgramResult build = scene_.BuildViewGraph(scene_.database());
    ASSERT_EQ(build.exit_code, 0) << build.output;
  }

  ProgramResult Run(const std::string& command, const std::string& output,
                    const std::vector<std::string>& others = {}) const {
    std::vector<std::string> arguments = {command,        "--database_path", scene_.database(),
                                          "--image_path", scene_.images(),   "--output_path",
                                          output,         "--report",        "0"};
    arguments.insert(arguments.end(), others.begin(), others.end());
    return RunProgram("global_sfm", arguments);
  }

  const SceneFiles scene_;
  std::vector<std::string> later_;
};

TEST_F(AddingTest, NewPhotographsAreNewWorkAndJoinTheModel) {
  Add();
  const std::string report = scene_.database() + ".report.json";
  EXPECT_EQ(ValueOf(report, "cameras", "new_images"), 2);
  EXPECT_EQ(ValueOf(report, "features", "computed"), 2);
  EXPECT_EQ(ValueOf(report, "depth", "computed"), 2);
  // Of 10 photographs, the pairs with one of the new two.
  EXPECT_EQ(ValueOf(report, "matching", "computed"), 45 - 28);
  EXPECT_EQ(ValueOf(report, "verification", "pairs"), 45 - 28);
  // The model goes on in its own folder.
  const Reconstruction before = ReadColmapModel(scene_ / "out/sparse/0");
  const ProgramResult run = Run("reconstruct", scene_ / "out", {"--input_path", scene_ / "out"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const Reconstruction after = ReadColmapModel(scene_ / "out/sparse/0");
  EXPECT_EQ(after.images.size(), 8u);
  EXPECT_EQ(ValueOf(scene_ / "out/report.json", "input", "images_to_register"), 4);
  EXPECT_EQ(ValueOf(scene_ / "out/report.json", "registration", "registered"), 2);
  double extent = 0, move = 0;
  for (const auto& [id, image] : before.images) {
    const Eigen::Vector3d center = image.cam_from_world.Center();
    extent =
        std::max(extent, (center - before.images.begin()->second.cam_from_world.Center()).norm());
    move = std::max(move, (after.images.at(id).cam_from_world.Center() - center).norm());
  }
  EXPECT_LT(move, 0.02 * extent);
  // Nothing is left to do.
  ASSERT_EQ(scene_.BuildViewGraph(scene_.database()).exit_code, 0);
  EXPECT_EQ(ValueOf(report, "features", "computed"), 0);
  EXPECT_EQ(ValueOf(report, "matching", "computed"), 0);
  EXPECT_EQ(ValueOf(report, "verification", "pairs"), 0);
}

TEST_F(AddingTest, ARemovedPhotographIsToldAndDropped) {
  const Reconstruction before = ReadColmapModel(scene_ / "out/sparse/0");
  const std::string name = before.images.begin()->second.image.name;
  fs::rename(scene_.images() + "/" + name, scene_ / ("later/" + name));
  const ProgramResult told = scene_.BuildViewGraph(scene_.database());
  EXPECT_EQ(told.exit_code, 0);
  EXPECT_THAT(told.output, HasSubstr("no longer has 1 photographs of the database: " + name));
  EXPECT_THAT(told.output, HasSubstr("--drop_missing"));
  const ProgramResult dropped = scene_.BuildViewGraph(scene_.database(), {"--drop_missing", "1"});
  EXPECT_EQ(dropped.exit_code, 0) << dropped.output;
  EXPECT_EQ(ValueOf(scene_.database() + ".report.json", "cameras", "dropped"), 1);
  EXPECT_EQ(ValueOf(scene_.database() + ".report.json", "matching", "computed"), 0);
  const ProgramResult run = Run("reconstruct", scene_ / "out", {"--input_path", scene_ / "out"});
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("1 images of the input model that are not in the database"));
  EXPECT_EQ(ReadColmapModel(scene_ / "out/sparse/0").images.size(), 5u);
}

TEST_F(AddingTest, RefineTakesTheModelAloneAndTouchesNobodyElses) {
  Add();
  // A COLMAP workspace.
  WriteColmapModel(ReadColmapModel(scene_ / "out/sparse/0"), scene_ / "other/sparse/0",
                   ColmapModelFormat::kText);
  const ProgramResult refused =
      Run("refine", scene_ / "other", {"--input_path", scene_ / "other/sparse/0"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.output, HasSubstr("--overwrite"));
  const ProgramResult run =
      Run("refine", scene_ / "refined", {"--input_path", scene_ / "other/sparse/0"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_EQ(ReadColmapModel(scene_ / "refined/sparse/0").images.size(), 6u);
  EXPECT_THAT(ReadFile(scene_ / "refined/report.json"), HasSubstr("\"global_sfm refine\""));
}

TEST_F(AddingTest, AModelThatCannotBeUsedIsTold) {
  const ProgramResult none = Run("refine", scene_ / "refined");
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.output, HasSubstr("input_path"));
  const ProgramResult absent =
      Run("reconstruct", scene_ / "again", {"--input_path", scene_ / "no_such_model"});
  EXPECT_EQ(absent.exit_code, 3);
  EXPECT_THAT(absent.output, HasSubstr("no_such_model"));
  Reconstruction other = ReadColmapModel(scene_ / "out/sparse/0");
  for (auto& [id, image] : other.images) image.image.name = "x" + image.image.name;
  WriteColmapModel(other, scene_ / "other");
  const ProgramResult foreign =
      Run("reconstruct", scene_ / "again", {"--input_path", scene_ / "other"});
  EXPECT_EQ(foreign.exit_code, 1);
  EXPECT_THAT(foreign.output, HasSubstr("fewer than two images of the input model can be used"));
}

}  // namespace
}  // namespace cairn
