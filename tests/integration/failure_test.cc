// Each kind of broken input gives one clear line with the file and the reason, and the rest goes
// on.
#include <fstream>

#include "cairn/database/database.h"
#include "integration/scene_files.h"
#include "support/database_dump.h"
#include "support/test.h"

namespace cairn {
namespace {

void WriteText(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

// The program goes on (exit code 0), and exactly one line names the file, with the reason.
void ExpectSkipped(const ProgramResult& result, const std::string& file,
                   const std::string& reason) {
  EXPECT_EQ(result.exit_code, 0) << result.output;
  const std::vector<std::string> lines = LinesWith(result.output, file);
  ASSERT_THAT(lines, SizeIs(1)) << result.output;
  EXPECT_THAT(lines[0], AllOf(HasSubstr("warning"), HasSubstr(reason)));
}

// The program ends with the exit code, and its last line names the file, with the reason.
void ExpectEnd(const ProgramResult& result, int exit_code, const std::string& name,
               const std::string& reason) {
  EXPECT_EQ(result.exit_code, exit_code) << result.output;
  const std::vector<std::string> lines = LinesWith(result.output, " error ");
  ASSERT_THAT(lines, SizeIs(1)) << result.output;
  EXPECT_THAT(lines[0], AllOf(HasSubstr(name), HasSubstr(reason)));
}

TEST(Failure, BrokenImagesAreSkipped) {
  const SceneFiles scene;
  std::filesystem::resize_file(scene / "images/image00003.jpg", 20000);
  WriteText(scene / "images/zero.jpg", "");
  WriteText(scene / "images/text.jpg", "This is no photograph.\n");
  WriteText(scene / "images/short.pgm", "P5\n4 4\n255\nab");
  const std::string database = scene / "new.db";
  const ProgramResult result = scene.BuildViewGraph(database, {"--stop_after", "features"});
  ExpectSkipped(result, "image00003.jpg", "truncated");
  ExpectSkipped(result, "zero.jpg", "empty");
  ExpectSkipped(result, "text.jpg", "not an image");
  ExpectSkipped(result, "short.pgm", "cannot be decoded");
  EXPECT_THAT(LinesWith(result.output, "imdecode"), IsEmpty());  // OpenCV's own
  const Database features(database, Database::Mode::kReadOnly);
  EXPECT_EQ(features.ReadNumKeypoints().size(), 9u);  // 10 photographs, 1 of them truncated
}

TEST(Failure, MissingAndBrokenDepthMapsLeaveTheImageWithoutDepth) {
  const SceneFiles scene;
  std::filesystem::remove(scene / "depth/image00002.jpg.npy");
  WriteText(scene / "depth/image00004.jpg.npy", "no array");
  const ProgramResult result = scene.BuildViewGraph(
      scene.database(), {"--recompute", "depth", "--stop_after", "verification"});
  ExpectSkipped(result, "image00002.jpg", "no depth map");
  ExpectSkipped(result, "image00004.jpg", "not a .npy file");
  const Database database(scene.database(), Database::Mode::kReadOnly);
  EXPECT_EQ(database.ReadTwoViewGeometryPairIds().empty(), false);
}

TEST(Failure, WhatDoesNothingForAnotherProgramsDatabaseIsAWarning) {
  const SceneFiles scene;
  RunSql(scene.database(), "DELETE FROM cairn_jobs");
  RunSql(scene.database(), "DELETE FROM cairn_stages");
  RunSql(scene.database(), "DELETE FROM cairn_photos");
  const ProgramResult result =
      RunProgram("build_view_graph", {"--database_path", scene.database(), "--matching.max_ratio",
                                      "0.6", "--camera_model", "PINHOLE"});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output,
              HasSubstr("nothing was computed with --camera_model, --matching.max_ratio"));
  std::filesystem::create_directory(scene / "above");
  std::filesystem::rename(scene.images(), scene / "above/images");
  const ProgramResult above = RunProgram(
      "build_view_graph", {"--database_path", scene.database(), "--image_path", scene / "above",
                           "--stop_after", "features", "--features.max_num_features", "100"});
  EXPECT_THAT(above.output, HasSubstr("has no files of the names of 10 images"));
}

TEST(Failure, ADatabaseThatIsNone) {
  const SceneFiles scene;
  WriteText(scene / "bad.db", "This is no database.\n");
  ExpectEnd(scene.BuildViewGraph(scene / "bad.db"), 3, "bad.db", "not an SQLite database");
  ExpectEnd(RunProgram("global_sfm", {"inspect", "--database_path", scene / "bad.db"}), 3, "bad.db",
            "not an SQLite database");
  std::filesystem::resize_file(scene.database(), 5000);
  ExpectEnd(scene.BuildViewGraph(scene.database()), 3, "scene.db", "damaged");
}

TEST(Failure, OutputThatCannotBeWritten) {
  const SceneFiles scene;
  WriteText(scene / "file", "a file in place of a folder");
  ExpectEnd(scene.BuildViewGraph(scene / "file/new.db"), 3, "file/new.db", "cannot be");
  ExpectEnd(RunProgram("global_sfm", {"synthesize", "--output_path", scene / "file/x"}), 3,
            "file/x", "cannot be created");
}

TEST(Failure, InputThatIsAbsent) {
  const SceneFiles scene;
  ExpectEnd(RunProgram("build_view_graph",
                       {"--image_path", scene / "nowhere", "--database_path", scene / "new.db"}),
            3, "nowhere", "no such folder");
  std::filesystem::create_directory(scene / "empty");
  ExpectEnd(RunProgram("build_view_graph",
                       {"--image_path", scene / "empty", "--database_path", scene / "new.db"}),
            3, "empty", "no photograph");
}

TEST(Failure, OnePhotographAlone) {
  const SceneFiles scene;
  std::filesystem::create_directory(scene / "one");
  std::filesystem::copy(scene / "images/image00000.jpg", scene / "one");
  ExpectEnd(RunProgram("build_view_graph",
                       {"--image_path", scene / "one", "--database_path", scene / "one.db"}),
            1, "one photograph alone", "give two or more");
}

// A run without a usable result: exit code 1, one line that says where and what to try, the report
// and the graph; the database stays as it is, and the next run with it succeeds.
TEST(Failure, ReconstructionThatFailsLeavesWhatThereIs) {
  const SceneFiles scene;
  const auto reconstruct = [&](std::vector<std::string> others) {
    std::vector<std::string> arguments = {"reconstruct", "--database_path", scene.database(),
                                          "--output_path", scene / "model"};
    arguments.insert(arguments.end(), others.begin(), others.end());
    return RunProgram("global_sfm", arguments);
  };
  const std::string before = DumpDatabase(scene.database());
  struct Case {
    std::vector<std::string> options;
    std::string stage, advice;
  };
  for (const Case& c :
       {Case{{"--view_graph.min_num_inliers", "100000"}, "view_graph: of ", "too_few_inliers"},
        Case{{"--reconstruct.max_memory_gib", "0.001"},
             "read: the memory is too small",
             "--reconstruct.max_memory_gib"}}) {
    const ProgramResult result = reconstruct(c.options);
    EXPECT_EQ(result.exit_code, 1) << result.output;
    const std::vector<std::string> lines = LinesWith(result.output, " error " + c.stage);
    ASSERT_THAT(lines, SizeIs(1)) << result.output;
    EXPECT_THAT(lines[0], HasSubstr(c.advice));
    for (const char* file :
         {"model/report.json", "model/view_graph.json", "model/effective.toml"}) {
      EXPECT_TRUE(std::filesystem::exists(scene / file)) << file;
    }
    EXPECT_FALSE(std::filesystem::exists(scene / "model/sparse/0"));
  }
  EXPECT_EQ(DumpDatabase(scene.database()), before);
  EXPECT_EQ(reconstruct({}).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(scene / "model/sparse/0"));
}

TEST(Failure, UnknownFlagsAndKeysSuggestTheNearestName) {
  const SceneFiles scene;
  ExpectEnd(scene.BuildViewGraph(scene.database(), {"--matching.max_rato", "0.7"}), 2,
            "--matching.max_rato", "--matching.max_ratio");
  WriteText(scene / "options.toml", "[matching]\nmax_rato = 0.7\n");
  ExpectEnd(scene.BuildViewGraph(scene.database(), {"--config", scene / "options.toml"}), 2,
            "matching.max_rato", "matching.max_ratio");
  WriteText(scene / "broken.toml", "[matching\n");
  ExpectEnd(scene.BuildViewGraph(scene.database(), {"--config", scene / "broken.toml"}), 2,
            "broken.toml", ":1");
  ExpectEnd(scene.BuildViewGraph(scene.database(), {"--matching.max_ratio", "7"}), 2,
            "matching.max_ratio", "out of range");
  ExpectEnd(RunProgram("global_sfm", {"reconstrukt"}), 2, "reconstrukt", "unknown command");
  ExpectEnd(RunProgram("global_sfm", {"synthesise"}), 2, "synthesise", "'synthesize'");
  ExpectEnd(RunProgram("global_sfm", {"--database_path", scene.database(), "inspect"}), 2,
            "options go after the command", "global_sfm inspect --database_path");
  ExpectEnd(RunProgram("global_sfm", {"--database_path", scene.database()}), 2,
            "options go after the command", "--help");
}

TEST(Failure, AReportSaysWhichDatabaseItNeeds) {
  const SceneFiles scene;
  ExpectEnd(RunProgram("global_sfm", {"report", "--model_path", SceneFiles::truth(),
                                      "--output_path", scene / "report.html"}),
            2, "--database_path", "pairs are in the database");
}

}  // namespace
}  // namespace cairn
