// build_view_graph under mpirun: the database is the same for any number of ranks, whichever of
// them were killed before.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "cairn/base/timer.h"
#include "integration/scene_files.h"
#include "support/database_dump.h"
#include "support/test.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

const char* const kProgram = CAIRN_BINARY_DIR "/bin/build_view_graph";

// Runs its arguments as a program with its output in the file $3; the rank $1 is killed $2 seconds
// after the helpers are there. A rank that dies before can leave mpirun itself waiting forever
// (PMIx 4.2.2, in PMIx_server_finalize).
const char* const kKillRank =
    "rank=$1; seconds=$2; output=$3; shift 3; "
    "if [ $OMPI_COMM_WORLD_RANK = $rank ]; then "
    "(until grep -q ' helps, with ' $output; do sleep 0.01; kill -0 $$ || exit; done; "
    "sleep $seconds; kill -9 $$) >/dev/null 2>&1 & fi; exec \"$@\" >>$output 2>&1";

class Mpi : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!CAIRN_HAS_MPI) GTEST_SKIP() << "built without MPI";
    for (const char* name : {"OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"}) {
      setenv(name, "1", 1);
    }
  }

  static ProgramResult MpiRun(int num_ranks, const std::vector<std::string>& command) {
    std::vector<std::string> arguments = {"--oversubscribe", "--bind-to", "none", "-n",
                                          std::to_string(num_ranks)};
    arguments.insert(arguments.end(), command.begin(), command.end());
    return RunExecutable("mpirun", arguments);
  }

  std::vector<std::string> Command(const std::string& database) const {
    return {kProgram,
            "--image_path",
            scene_.images(),
            "--depth_path",
            scene_ / "depth",
            "--database_path",
            database,
            "--features.max_num_features",
            "800",
            "--num_threads",
            "1"};
  }

  // The same with rank `rank` killed after some seconds of work.
  ProgramResult MpiRunAndKill(int num_ranks, const std::string& database, int rank,
                              double seconds) const {
    const std::string output = database + ".output";
    fs::remove(output);
    std::vector<std::string> command = {
        "sh", "-c", kKillRank, "sh", std::to_string(rank), std::to_string(seconds), output};
    for (const std::string& word : Command(database)) command.push_back(word);
    return MpiRun(num_ranks, command);
  }

  // Runs until it is done, killed after `first` seconds and ever later. How often it was killed.
  int KillUntilDone(int num_ranks, const std::string& database, int rank, double first) const {
    int num_kills = 0;
    for (double limit = first; num_kills < 20; limit += 0.5 * first) {
      const ProgramResult result = MpiRunAndKill(num_ranks, database, rank, limit);
      if (result.exit_code == 0) break;
      ++num_kills;
      EXPECT_THAT(result.output, HasSubstr("rank " + std::to_string(rank) + " with PID"));
      EXPECT_THAT(result.output, HasSubstr("on node"));
    }
    return num_kills;
  }

  std::string Reference() const { return DumpDatabase(scene_.database()); }

  const SceneFiles scene_;
};

TEST_F(Mpi, EqualDumpsForAnyNumberOfRanks) {
  for (const int num_ranks : {1, 2, 4}) {
    const std::string database = scene_ / (std::to_string(num_ranks) + ".db");
    const ProgramResult result = MpiRun(num_ranks, Command(database));
    ASSERT_EQ(result.exit_code, 0) << result.output;
    EXPECT_EQ(LinesWith(result.output, " helps, with 1 thread").size(), num_ranks - 1u);
    EXPECT_TRUE(DumpDatabase(database) == Reference()) << num_ranks << " ranks";
  }
}

TEST_F(Mpi, EqualDumpsAfterKilledRanks) {
  const Timer timer;
  ASSERT_EQ(MpiRun(3, Command(scene_ / "whole.db")).exit_code, 0);
  const double seconds = timer.Seconds();
  for (const int rank : {0, 2}) {
    const std::string database = scene_ / ("killed" + std::to_string(rank) + ".db");
    int num_kills = 0;
    // Where the machine was busier before, a run may end after one kill: once more, killed sooner.
    for (double first = 0.2 * seconds; num_kills < 2 && first > 0.01 * seconds; first /= 2) {
      fs::remove(database);
      num_kills = KillUntilDone(3, database, rank, first);
    }
    EXPECT_GE(num_kills, 2);
    EXPECT_TRUE(DumpDatabase(database) == Reference()) << "rank " << rank;
  }
}

// What one number of ranks began, another goes on with.
TEST_F(Mpi, StagesWithDifferentNumbersOfRanks) {
  const std::string database = scene_ / "stages.db";
  const std::vector<std::pair<int, std::string>> steps = {
      {2, "features"}, {4, "depth"}, {1, "matching"}, {3, "verification"}};
  for (const auto& [num_ranks, stage] : steps) {
    std::vector<std::string> command = Command(database);
    command.insert(command.end(), {"--stop_after", stage});
    const ProgramResult result = MpiRun(num_ranks, command);
    ASSERT_EQ(result.exit_code, 0) << result.output;
  }
  EXPECT_TRUE(DumpDatabase(database) == Reference());
}

TEST_F(Mpi, AnotherBuildIsRefusedWithItsName) {
  const std::string other = scene_ / "build_view_graph";
  fs::copy(kProgram, other);
  std::ofstream(other, std::ios::app) << "x";
  const std::string database = scene_ / "a.db";
  std::vector<std::string> command = Command(database);
  command.insert(command.end(), {":", "-n", "1", other});
  const ProgramResult result = MpiRun(1, command);
  EXPECT_EQ(result.exit_code, 2) << result.output;
  EXPECT_THAT(result.output, HasSubstr("rank 1 on "));
  EXPECT_THAT(result.output, HasSubstr("another build"));
}

// Rank 1 is in a folder where the relative path leads nowhere.
TEST_F(Mpi, PhotographsThatAreNotSharedEndTheRun) {
  std::vector<std::string> command = {
      "sh", "-c", "cd \"$1\"; shift; [ $OMPI_COMM_WORLD_RANK = 0 ] || cd /; exec \"$@\"", "sh",
      fs::path(scene_.images()).parent_path()};
  for (const std::string& word : Command(scene_ / "a.db")) command.push_back(word);
  *std::find(command.begin(), command.end(), scene_.images()) = "images";
  const ProgramResult result = MpiRun(2, command);
  EXPECT_EQ(result.exit_code, 3) << result.output;
  EXPECT_THAT(result.output, HasSubstr("rank 1 on "));
  EXPECT_THAT(result.output, HasSubstr("the same photographs"));
}

TEST_F(Mpi, AWrongFlagIsToldOnce) {
  const ProgramResult result = MpiRun(3, {kProgram, "--wrong_flag"});
  EXPECT_EQ(result.exit_code, 2) << result.output;
  EXPECT_EQ(LinesWith(result.output, "wrong_flag").size(), 1u) << result.output;
}

}  // namespace
}  // namespace cairn
