// What an adversary, a damaged disk or a small machine may do to the programs: they end with one of
// the exit codes 0 to 3 in a short time, say why, and touch nobody's files.
#include <sys/stat.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "cairn/base/types.h"
#include "integration/scene_files.h"
#include "support/database_dump.h"
#include "support/test.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

constexpr double kMaxSeconds = 60;  // of any run here; a hang ends as 137

ProgramResult Reconstruct(const std::string& database, const std::string& output,
                          std::vector<std::string> others = {}) {
  std::vector<std::string> arguments = {"reconstruct", "--database_path", database, "--output_path",
                                        output};
  arguments.insert(arguments.end(), others.begin(), others.end());
  return RunProgram("global_sfm", arguments, kMaxSeconds);
}

// The program under `ulimit`, or with a signal sent to it.
ProgramResult RunShell(const std::string& script, const std::vector<std::string>& arguments = {}) {
  std::vector<std::string> all = {"-c", script, "bash"};
  all.insert(all.end(), arguments.begin(), arguments.end());
  return RunExecutable("bash", all, kMaxSeconds);
}

std::string Program(const std::string& name) { return CAIRN_BINARY_DIR "/bin/" + name; }

TEST(Hostile, APipeIsNoPhotograph) {
  const SceneFiles scene;
  ASSERT_EQ(mkfifo((scene / "images/pipe.jpg").c_str(), 0600), 0);
  ASSERT_EQ(mkfifo((scene / "pipe").c_str(), 0600), 0);
  const ProgramResult result =
      scene.BuildViewGraph(scene / "new.db", {"--stop_after", "features"}, kMaxSeconds);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("pipe.jpg: is a pipe or a device, not a file; skipped"));
  for (const std::string flag : {"--config", "--pairs_path", "--database_path"}) {
    const ProgramResult refused =
        RunProgram("build_view_graph", {"--database_path", scene.database(), flag, scene / "pipe"},
                   kMaxSeconds);
    EXPECT_EQ(refused.exit_code, 3) << flag << refused.output;
    EXPECT_THAT(refused.output, HasSubstr("is a pipe or a device")) << flag;
  }
  EXPECT_EQ(Reconstruct(scene / "pipe", scene / "out").exit_code, 3);
}

// A stage that does not look for signals is ended after a second. (SIGTERM; SIGINT is ignored in
// background jobs of a shell.)
TEST(Hostile, ASignalEndsEveryStage) {
  const SceneFiles scene;
  const auto stop_after = [](double delay, const std::vector<std::string>& command) {
    const std::string script =
        "\"$@\" & sleep " + std::to_string(delay) +
        "; kill -TERM $! 2>/dev/null; start=$(date +%s%N); wait $!; "
        "code=$?; echo milliseconds $(( ($(date +%s%N) - start) / 1000000 )); exit $code";
    const ProgramResult result = RunShell(script, command);
    EXPECT_THAT(result.exit_code, AnyOf(0, 1, 143)) << result.output;
    const std::vector<std::string> lines = LinesWith(result.output, "milliseconds ");
    // A busy machine takes its time; what did not end at all took minutes.
    EXPECT_TRUE(lines.size() == 1 && std::stoi(lines[0].substr(13)) < 5000) << result.output;
    return result.exit_code;
  };
  for (const double delay : {0.05, 0.2, 0.5, 1.0}) {
    const std::string name = scene / ("new" + std::to_string(delay));
    const int exit_code =
        stop_after(delay, {Program("build_view_graph"), "--image_path", scene.images(),
                           "--database_path", name + ".db", "--num_threads", "1"});
    // Features alone take a second.
    EXPECT_TRUE(exit_code != 0 || delay > 0.3) << "it went on to the end";
    stop_after(delay / 2, {Program("global_sfm"), "reconstruct", "--database_path",
                           scene.database(), "--output_path", name, "--num_threads", "1"});
  }
  // What takes minutes is not done.
  EXPECT_NE(stop_after(0.3, {Program("global_sfm"), "synthesize", "--num_images", "1000",
                             "--output_path", scene / "photos"}),
            0);
  EXPECT_NE(stop_after(0.3, {Program("relative_pose_experiments"), "--output_path",
                             scene / "tables", "--experiment", "noise"}),
            0);
}

// From where the programs begin at all to where they have enough.
TEST(Hostile, TooLittleMemoryIsAnErrorOfTheEnvironment) {
  const SceneFiles scene;
  int num_short = 0;
  for (int limit_mib = 200; limit_mib <= 560; limit_mib += 40) {
    const std::string prefix = "ulimit -v " + std::to_string(1024 * limit_mib) + "; exec \"$@\"";
    const std::string output = scene / ("out" + std::to_string(limit_mib));
    const std::string threads = limit_mib / 40 % 2 == 0 ? "1" : "2";
    for (const std::vector<std::string>& command :
         {std::vector<std::string>{Program("global_sfm"), "reconstruct", "--database_path",
                                   scene.database(), "--output_path", output, "--num_threads",
                                   threads},
          {Program("build_view_graph"), "--image_path", scene.images(), "--database_path",
           output + ".db", "--features.max_num_features", "800", "--num_threads", threads}}) {
      const ProgramResult result = RunShell(prefix, command);
      // 127: the system's loader cannot even load the libraries.
      EXPECT_THAT(result.exit_code, AnyOf(0, 3, 127)) << limit_mib << " MiB\n" << result.output;
      num_short += result.exit_code == 3;
      if (result.exit_code == 3) {
        EXPECT_THAT(result.output, AnyOf(HasSubstr("memory"), HasSubstr("hread")));
      }
    }
  }
  EXPECT_GT(num_short, 0);
}

// Rows that no COLMAP writes: named and left out, in the words of the database's reader.
TEST(Hostile, BadRowsAreNamedAndLeftOut) {
  const SceneFiles scene;
  RunSql(
      scene.database(),
      "UPDATE cameras SET params = x'00' WHERE camera_id = 1; UPDATE two_view_geometries SET "
      "pair_id = -5 WHERE pair_id = (SELECT MIN(pair_id) FROM two_view_geometries WHERE rows > 0)");
  for (const ProgramResult& result :
       {Reconstruct(scene.database(), scene / "out"),
        RunProgram("global_sfm", {"inspect", "--database_path", scene.database()}, kMaxSeconds),
        RunProgram("build_view_graph", {"--database_path", scene.database()}, kMaxSeconds)}) {
    EXPECT_EQ(result.exit_code, 0) << result.output;
    EXPECT_THAT(result.output, AllOf(HasSubstr("camera 1"), HasSubstr("the id is negative")));
  }
}

TEST(Hostile, VerifiedMatchesOfKeypointsThatAreNotThere) {
  const SceneFiles scene;
  RunSql(scene.database(),
         "UPDATE two_view_geometries SET rows = 1, data = x'FFFFFF7F00000000' WHERE pair_id = "
         "(SELECT MIN(pair_id) FROM two_view_geometries WHERE rows > 0)");
  const ProgramResult result = Reconstruct(scene.database(), scene / "out");
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("refer to keypoints that are not there; the pair is left"));
}

// A run that was interrupted when it made the file.
TEST(Hostile, AnEmptyDatabaseIsFilled) {
  const SceneFiles scene;
  RunSql(scene / "new.db", "CREATE TABLE x(y); DROP TABLE x;");
  const ProgramResult result = scene.BuildViewGraph(scene / "new.db", {"--stop_after", "features"});
  EXPECT_EQ(result.exit_code, 0) << result.output;
}

TEST(Hostile, AWorkspaceOfColmapIsNotTouched) {
  const SceneFiles scene;
  const std::string workspace = scene / "workspace";
  for (const char* model : {"sparse/0", "sparse/1"}) {
    CreateFolders(workspace + "/" + model);
    WriteFileAtomically(workspace + "/" + model + "/cameras.bin", "COLMAP's");
  }
  const ProgramResult refused = Reconstruct(scene.database(), workspace);
  EXPECT_EQ(refused.exit_code, 2) << refused.output;
  EXPECT_THAT(refused.output, HasSubstr("--overwrite"));
  EXPECT_THAT(refused.output, Not(HasSubstr("view_graph")));  // before the work
  // Nor after a run that failed.
  EXPECT_EQ(Reconstruct(scene / "absent.db", workspace, {"--overwrite"}).exit_code, 3);
  EXPECT_EQ(Reconstruct(scene.database(), workspace).exit_code, 2);
  EXPECT_EQ(ReadFile(workspace + "/sparse/1/cameras.bin"), "COLMAP's");
  EXPECT_EQ(std::distance(fs::directory_iterator(workspace), fs::directory_iterator()), 1);
}

TEST(Hostile, WithoutADatabaseThereIsNoFolderOfResults) {
  const SceneFiles scene;
  EXPECT_EQ(Reconstruct(scene / "absent.db", scene / "out").exit_code, 3);
  EXPECT_FALSE(fs::exists(scene / "out"));
}

TEST(Hostile, AFailedRunLeavesTheModelOfTheLast) {
  const SceneFiles scene;
  EXPECT_EQ(Reconstruct(scene.database(), scene / "out").exit_code, 0);
  const std::string images = ReadFile(scene / "out/sparse/0/images.bin");
  const std::string report = ReadFile(scene / "out/report.json");
  const ProgramResult failed =
      Reconstruct(scene.database(), scene / "out", {"--view_graph.min_num_inliers", "100000"});
  EXPECT_EQ(failed.exit_code, 1) << failed.output;
  EXPECT_THAT(failed.output, HasSubstr("out/failed/report.html"));
  EXPECT_EQ(ReadFile(scene / "out/sparse/0/images.bin"), images);
  EXPECT_EQ(ReadFile(scene / "out/report.json"), report);
  EXPECT_EQ(Reconstruct(scene.database(), scene / "out").exit_code, 0);
  EXPECT_FALSE(fs::exists(scene / "out/failed"));
}

// Models of a run that was stopped are there, and used when somebody wants them; not unknowingly.
TEST(Hostile, UnfinishedModelsAreWarnedOf) {
  const SceneFiles scene;
  const std::string model = scene / "out";
  ASSERT_EQ(Reconstruct(scene.database(), model).exit_code, 0);
  const auto warnings_of = [&](const std::string& path, std::vector<std::string> command) {
    command.insert(command.end(), {"--model_path", path});
    const ProgramResult result = RunProgram("global_sfm", command, kMaxSeconds);
    EXPECT_EQ(result.exit_code, 0) << result.output;
    return LinesWith(result.output, "models are unfinished").size();
  };
  const std::vector<std::vector<std::string>> commands = {
      {"inspect"},
      {"evaluate", "--reference_path", SceneFiles::truth()},
      {"export", "--output_path", scene / "exported", "--output_type", "ply"},
      {"undistort", "--image_path", scene.images(), "--output_path", scene / "dense"}};
  for (const auto& command : commands) EXPECT_EQ(warnings_of(model, command), 0u) << command[0];
  nlohmann::json report = nlohmann::json::parse(ReadFile(model + "/report.json"));
  report["succeeded"] = false;
  WriteFileAtomically(model + "/report.json", report.dump());
  for (const auto& command : commands) EXPECT_EQ(warnings_of(model, command), 1u) << command[0];
  for (const char* path : {"/sparse/0", "/sparse/0/", "/bundle.out"}) {
    EXPECT_EQ(warnings_of(model + path, {"inspect"}), 1u) << path;
  }
  const ProgramResult refined =
      RunProgram("global_sfm", {"refine", "--input_path", model, "--database_path",
                                scene.database(), "--output_path", scene / "refined"});
  EXPECT_THAT(refined.output, HasSubstr("models are unfinished"));
  WriteFileAtomically(model + "/report.json", "{\"succeeded\": 3");  // says nothing
  EXPECT_EQ(warnings_of(model, {"inspect"}), 0u);
}

TEST(Hostile, BundlerGetsItsSizesFromThePhotographs) {
  const SceneFiles scene;
  const std::string bundle = scene.ExportBundler();
  const auto export_to = [&](const std::string& type, std::vector<std::string> others) {
    std::vector<std::string> arguments = {"export",     "--model_path",  bundle, "--output_path",
                                          scene / type, "--output_type", type};
    arguments.insert(arguments.end(), others.begin(), others.end());
    return RunProgram("global_sfm", arguments, kMaxSeconds);
  };
  for (const std::string type : {"colmap_bin", "colmap_txt", "nerfstudio"}) {
    const ProgramResult refused = export_to(type, {});
    EXPECT_EQ(refused.exit_code, 2) << refused.output;
    EXPECT_THAT(refused.output, HasSubstr("image_path: the model has no image sizes"));
    EXPECT_EQ(export_to(type, {"--image_path", scene.images()}).exit_code, 0);
  }
  const ProgramResult same = RunProgram(
      "global_sfm",
      {"evaluate", "--model_path", scene / "colmap_bin", "--reference_path", SceneFiles::truth()});
  EXPECT_EQ(same.exit_code, 0) << same.output;
}

}  // namespace
}  // namespace cairn
