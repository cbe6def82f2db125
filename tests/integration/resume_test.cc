// The database is the same for any number of threads, and however often the program was killed.
#include "cairn/base/timer.h"
#include "integration/scene_files.h"
#include "support/database_dump.h"
#include "support/test.h"

namespace cairn {
namespace {

TEST(Determinism, EqualDumpsForAnyNumberOfThreads) {
  const SceneFiles scene;
  const std::string reference = DumpDatabase(scene.database());  // made with all threads
  for (const std::string threads : {"1", "2", "8"}) {
    const std::string database = scene / (threads + ".db");
    const ProgramResult result = scene.BuildViewGraph(database, {"--num_threads", threads});
    ASSERT_EQ(result.exit_code, 0) << result.output;
    EXPECT_TRUE(DumpDatabase(database) == reference) << threads << " threads";
  }
}

TEST(Determinism, EqualDumpsAfterKills) {
  const SceneFiles scene;
  const std::string reference = DumpDatabase(scene.database());
  const Timer timer;
  ASSERT_EQ(scene.BuildViewGraph(scene / "whole.db").exit_code, 0);
  const double seconds = timer.Seconds();
  const std::string database = scene / "killed.db";
  // Each run gets a little longer than the one before, so that kills fall into every stage.
  int num_kills = 0;
  for (double limit = 0.1 * seconds; num_kills < 40; limit += 0.07 * seconds) {
    const ProgramResult result = scene.BuildViewGraph(database, {}, limit);
    if (result.exit_code == 0) break;
    ASSERT_EQ(result.exit_code, 128 + 9) << result.output;
    ++num_kills;
  }
  EXPECT_GE(num_kills, 2);
  EXPECT_TRUE(DumpDatabase(database) == reference);
}

TEST(Determinism, WhatIsNotGivenAgainStaysAsItWas) {
  const SceneFiles scene;
  const std::string database = scene / "continued.db";
  ASSERT_EQ(scene.BuildViewGraph(database, {"--stop_after", "matching"}).exit_code, 0);
  const ProgramResult result = RunProgram("build_view_graph", {"--database_path", database});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_TRUE(DumpDatabase(database) == DumpDatabase(scene.database()));
  // Stages that are computed again are not bound by it, those before them are.
  const ProgramResult again =
      RunProgram("build_view_graph", {"--database_path", database, "--recompute", "verification",
                                      "--verification.min_num_inliers", "40"});
  EXPECT_EQ(again.exit_code, 0) << again.output;
}

TEST(Determinism, WhatIsComputedAgainKeepsOptionsThatAreNotGiven) {
  const SceneFiles scene;
  const std::string database = scene / "again.db";
  const ProgramResult first = scene.BuildViewGraph(
      database, {"--camera_model", "PINHOLE", "--single_camera", "--features.type", "sift",
                 "--matching.max_ratio", "0.7", "--verifier", "five_point"});
  ASSERT_EQ(first.exit_code, 0) << first.output;
  const std::string dump = DumpDatabase(database);
  const ProgramResult again = RunProgram(
      "build_view_graph", {"--image_path", scene.images(), "--depth_path", scene / "depth",
                           "--database_path", database, "--recompute", "features"});
  ASSERT_EQ(again.exit_code, 0) << again.output;
  EXPECT_TRUE(DumpDatabase(database) == dump);
}

TEST(Determinism, AnotherSeedOrOptionIsNoticed) {
  const SceneFiles scene;
  const ProgramResult result =
      scene.BuildViewGraph(scene.database(), {"--matching.max_ratio", "0.7"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.output.find("matching.max_ratio"), std::string::npos) << result.output;
}

}  // namespace
}  // namespace cairn
