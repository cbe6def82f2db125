#include "common/program.h"

#include <filesystem>
#include <fstream>
#include <new>
#include <system_error>

#include "cairn/base/error.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

struct TopOptions {
  std::string image_path;
  int seed = 0;
  void VisitFields(OptionVisitor& v) {
    v.String("image_path", image_path, "folder of photographs");
    v.Int("seed", seed, {-5, 100}, "seed");
  }
};

enum class MatchKind { kFast, kSlow };
constexpr NamedValue<MatchKind> kMatchKinds[] = {{MatchKind::kFast, "fast"},
                                                 {MatchKind::kSlow, "slow"}};

struct MatchOptions {
  double max_ratio = 0.8;
  bool cross_check = true;
  std::vector<double> weights;
  MatchKind kind = MatchKind::kFast;
  void VisitFields(OptionVisitor& v) {
    v.Double("max_ratio", max_ratio, {0, 1}, "ratio");
    v.Bool("cross_check", cross_check, "mutual");
    v.Doubles("weights", weights, "weights");
    v.Choice("kind", kind, kMatchKinds, "kind");
  }
};

class ProgramTest : public ::testing::Test {
 protected:
  // Runs the program with the arguments; the options keep what was in force.
  int Run(
      std::vector<std::string> args, std::function<int()> run = [] { return 0; }) {
    Program program("prog", "test program");
    Command& command = program.MainCommand();
    command.AddOptions("", top_);
    command.AddOptions("matching", matching_);
    command.SetRun([&] {
      ++num_runs_;
      toml_ = command.EffectiveToml(left_out_);
      seed_is_set_ = command.IsSet("seed");
      if (!required_.empty()) command.Require(required_);
      return run();
    });
    args.insert(args.begin(), "prog");
    std::vector<char*> argv;
    for (std::string& arg : args) argv.push_back(arg.data());
    ::testing::internal::CaptureStderr();
    const int exit_code =
        RunMain([&] { return program.Run(static_cast<int>(argv.size()), argv.data()); });
    output_ = ::testing::internal::GetCapturedStderr();
    return exit_code;
  }

  std::string WriteConfig(const std::string& text) {
    const std::string path = folder_ / "config.toml";
    std::ofstream(path) << text;
    return path;
  }

  TempFolder folder_;
  TopOptions top_;
  MatchOptions matching_;
  std::vector<std::string> left_out_;
  std::string output_, toml_, required_;
  bool seed_is_set_ = false;
  int num_runs_ = 0;
};

TEST_F(ProgramTest, FlagsSetFieldsOfEveryKind) {
  EXPECT_EQ(Run({"--image_path", "a b", "--seed", "-3", "--matching.max_ratio=0.5",
                 "--matching.cross_check", "0", "--matching.weights", "1,-2.5,3", "--matching.kind",
                 "slow"}),
            0);
  EXPECT_EQ(top_.image_path, "a b");
  EXPECT_EQ(top_.seed, -3);
  EXPECT_EQ(matching_.max_ratio, 0.5);
  EXPECT_FALSE(matching_.cross_check);
  EXPECT_THAT(matching_.weights, ElementsAre(1, -2.5, 3));
  EXPECT_EQ(matching_.kind, MatchKind::kSlow);
  EXPECT_TRUE(seed_is_set_);
}

TEST_F(ProgramTest, WhatIsRequiredIsNotEmpty) {
  required_ = "image_path";
  EXPECT_EQ(Run({"--image_path", "a"}), kExitSuccess);
  EXPECT_EQ(Run({}), kExitUsage);
  EXPECT_EQ(Run({"--image_path", ""}), kExitUsage);
  EXPECT_EQ(Run({"--config", WriteConfig("image_path = \"\"\n")}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("--image_path: is required"));
}

TEST_F(ProgramTest, ListsAreOfNumbersAndForOptionsThatTakeThem) {
  EXPECT_EQ(Run({"--matching.weights", "1, -2.5, 3"}), 0);
  EXPECT_THAT(matching_.weights, ElementsAre(1, -2.5, 3));
  EXPECT_EQ(Run({"--matching.weights", "1,2,"}), kExitUsage);
  EXPECT_EQ(Run({"--matching.weights", "1 2,3"}), kExitUsage);  // not 12
  EXPECT_EQ(Run({"--config", WriteConfig("seed = [7]\n")}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("seed: takes one value, no list"));
}

TEST_F(ProgramTest, BooleanFlagsAcceptNothingZeroAndOne) {
  matching_.cross_check = false;
  EXPECT_EQ(Run({"--matching.cross_check", "--seed", "1"}), 0);
  EXPECT_TRUE(matching_.cross_check);
  EXPECT_EQ(Run({"--matching.cross_check", "0"}), 0);
  EXPECT_FALSE(matching_.cross_check);
  EXPECT_EQ(Run({"--matching.cross_check", "1"}), 0);
  EXPECT_TRUE(matching_.cross_check);
  EXPECT_EQ(Run({"--matching.cross_check=2"}), kExitUsage);
}

TEST_F(ProgramTest, FlagsOverrideTheFileAndTheFileOverridesDefaults) {
  const std::string path = WriteConfig(
      "seed = 7\n[matching]\nmax_ratio = 0.6\ncross_check = false\nweights = [1, 2.5]\n");
  EXPECT_EQ(Run({"--config", path, "--matching.max_ratio", "0.9"}), 0);
  EXPECT_EQ(top_.seed, 7);
  EXPECT_EQ(matching_.max_ratio, 0.9);
  EXPECT_FALSE(matching_.cross_check);
  EXPECT_THAT(matching_.weights, ElementsAre(1, 2.5));
}

TEST_F(ProgramTest, EffectiveTomlReadsBackToTheSameOptions) {
  EXPECT_EQ(Run({"--seed", "12", "--image_path", "x\"y\\z", "--matching.max_ratio", "0.1"}), 0);
  const std::string first = toml_;
  top_ = {};
  matching_ = {};
  EXPECT_EQ(Run({"--config", WriteConfig(first)}), 0);
  EXPECT_EQ(toml_, first);
  left_out_ = {"seed"};
  Run({"--seed", "3"});
  EXPECT_EQ(toml_.find("seed"), std::string::npos);
  EXPECT_EQ(top_.image_path, "x\"y\\z");
}

TEST_F(ProgramTest, ATomlBooleanIsNoNumber) {
  EXPECT_EQ(Run({"--config", WriteConfig("seed = true\n")}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("seed: 'true' is not an integer"));
  EXPECT_EQ(Run({"--config", WriteConfig("[matching]\nmax_ratio = false\n")}), kExitUsage);
  EXPECT_EQ(Run({"--config", WriteConfig("[matching]\ncross_check = false\n")}), 0);
  EXPECT_FALSE(matching_.cross_check);
}

TEST_F(ProgramTest, WrongInputIsAUsageErrorThatNamesTheKey) {
  EXPECT_EQ(Run({"--sede", "1"}), kExitUsage);
  EXPECT_THAT(output_, AllOf(HasSubstr("--sede"), HasSubstr("did you mean '--seed'")));
  EXPECT_EQ(Run({"--seed", "x"}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("seed"));
  EXPECT_EQ(Run({"--seed", "101"}), kExitUsage);
  top_ = {};
  EXPECT_EQ(Run({"--matching.kind", "other"}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("fast, slow"));
  matching_ = {};
  EXPECT_EQ(Run({"--config", WriteConfig("[matching]\nmax_ration = 1\n")}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("did you mean 'matching.max_ratio'"));
  EXPECT_EQ(Run({"--config", WriteConfig("seed = \n")}), kExitUsage);
  EXPECT_EQ(num_runs_, 0);
}

// What earlier versions wrote with the defaults goes on to work.
TEST_F(ProgramTest, OptionsThatWereTakenOutAreNamed) {
  EXPECT_EQ(Run({"--config", WriteConfig("[tracks]\nconflicts = 'split'\n")}), 0);
  EXPECT_EQ(Run({"--config", WriteConfig("[rotation_averaging]\nnum_threads = 3\n")}), 0);
  EXPECT_EQ(Run({"--config", WriteConfig("[tracks]\nconflicts = 'drop'\n")}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("'tracks.conflicts': this option was removed"));
  EXPECT_EQ(Run({"--tracks.conflicts", "drop"}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("it is always 'split'"));
}

TEST_F(ProgramTest, RenamedOptionsFailWithTheNewName) {
  EXPECT_EQ(Run({"--reconstruct.separate_twins", "0"}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("is now '--reconstruct.separate_duplicates'"));
  EXPECT_EQ(Run({"--config", WriteConfig("[reconstruct]\nseparate_twins = false\n")}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("is now 'reconstruct.separate_duplicates'"));
  EXPECT_EQ(Run({"--verification.rough_error_ratio", "7"}), kExitUsage);
  EXPECT_THAT(output_, HasSubstr("is now '--verification.rough_error_factor'"));
}

// Wherever a path cannot be looked at.
TEST(RunMain, APathThatCannotBeIsAnErrorOfInput) {
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  const std::string path(300, 'a');
  EXPECT_EQ(RunMain([&] { return std::filesystem::exists(path) ? 0 : 1; }), kExitIo);
  const std::string said =
      ::testing::internal::GetCapturedStdout() + ::testing::internal::GetCapturedStderr();
  EXPECT_THAT(said, HasSubstr(path + ": File name too long"));
}

TEST_F(ProgramTest, DefaultsGiveWayToWhatIsGiven) {
  Program program("prog", "test program");
  Command& command = program.MainCommand();
  command.AddOptions("", top_);
  command.AddOptions("matching", matching_);
  command.SetRun([&] {
    command.SetDefaults("seed = 5\nunknown = 1\nmatching.max_ratio = 0.4\nmatching.kind = 3.5e\n",
                        "a.db");
    return 0;
  });
  std::string name = "prog";
  char* argv[] = {name.data()};
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(RunMain([&] { return program.Run(1, argv); }), kExitIo);  // no TOML
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), HasSubstr("a.db"));
  command.SetRun([&] {
    command.SetDefaults(
        "seed = 5\nunknown = 1\n[matching]\nmax_ratio = 0.4\nweights = 'x'\nkind = 'old'\n",
        "a.db");
    return 0;
  });
  std::string flag = "--seed=9";
  char* with_seed[] = {name.data(), flag.data()};
  EXPECT_EQ(program.Run(2, with_seed), 0);
  EXPECT_EQ(top_.seed, 9);
  EXPECT_EQ(matching_.max_ratio, 0.4);
  EXPECT_TRUE(matching_.weights.empty());  // what cannot be read stays as it was
  EXPECT_EQ(matching_.kind, MatchKind::kFast);
}

TEST_F(ProgramTest, ErrorsBecomeExitCodes) {
  EXPECT_EQ(Run({}, [] { return int{kExitNoUsableResult}; }), kExitNoUsableResult);
  EXPECT_EQ(Run({}, []() -> int { throw IoError("f.jpg", "is empty"); }), kExitIo);
  EXPECT_THAT(output_, HasSubstr("f.jpg: is empty"));
  EXPECT_EQ(Run({}, []() -> int { throw ConfigError("k", "bad"); }), kExitUsage);
  EXPECT_EQ(Run({}, []() -> int { throw BugError("oops"); }), kExitBug);
  EXPECT_EQ(Run({}, []() -> int { throw 1; }), kExitBug);
  EXPECT_EQ(Run({}, []() -> int { throw std::bad_alloc(); }), kExitIo);
  EXPECT_THAT(output_, HasSubstr("out of memory"));
  const auto no_thread = std::make_error_code(std::errc::resource_unavailable_try_again);
  EXPECT_EQ(Run({}, [&]() -> int { throw std::system_error(no_thread); }), kExitIo);
  EXPECT_EQ(Run({"--config", "/nonexistent.toml"}), kExitIo);
}

}  // namespace
}  // namespace cairn
