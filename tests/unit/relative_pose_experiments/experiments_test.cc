#include "relative_pose_experiments/experiments.h"

#include <filesystem>

#include "cairn/base/file.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn::experiments {
namespace {

std::vector<FigureCheck> RunQuickly(const std::string& experiment, const std::string& output_path,
                                    int num_threads = 1) {
  ExperimentOptions options;
  options.experiment = experiment;
  options.output_path = output_path;
  options.quick = true;
  options.num_threads = num_threads;
  return RunExperiments(options, {}, NullMonitor());
}

// Figure 6 on the synthetic scene.
TEST(SceneExperiments, TablesDoNotDependOnTheNumberOfThreads) {
  const TempFolder folder;
  const auto checks = RunQuickly("pairs", folder / "one", 1);
  EXPECT_FALSE(checks.empty());
  for (const FigureCheck& check : checks) {
    EXPECT_TRUE(check.Holds()) << check.name << " = " << check.value;
  }
  RunQuickly("pairs", folder / "two", 2);
  int num_tables = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder / "one")) {
    const std::string name = file.path().filename().string();
    if (!name.ends_with(".csv") || name.ends_with("timings.csv")) continue;
    ++num_tables;
    EXPECT_EQ(ReadFile(file.path().string()), ReadFile(folder / "two/" + name)) << name;
  }
  EXPECT_EQ(num_tables, 4);
}

TEST(SceneExperiments, AnotherSeedIsAnotherScene) {
  const TempFolder folder;
  ExperimentOptions options;
  options.experiment = "pairs";
  options.quick = true;
  std::string tables[2];
  for (const int seed : {0, 1}) {
    options.seed = seed;
    options.output_path = folder / std::to_string(seed);
    for (const FigureCheck& check : RunExperiments(options, {}, NullMonitor())) {
      EXPECT_TRUE(check.Holds()) << check.name << " = " << check.value << ", seed " << seed;
    }
    tables[seed] = ReadFile(options.output_path + "/synthetic.simulated.pairs.csv");
  }
  EXPECT_NE(tables[0], tables[1]);
}

}  // namespace
}  // namespace cairn::experiments
