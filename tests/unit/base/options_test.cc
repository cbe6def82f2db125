#include "cairn/base/options.h"

#include <cmath>

#include "cairn/base/error.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

enum class TestType { kFast, kExact };
constexpr NamedValue<TestType> kTestTypes[] = {{TestType::kFast, "fast"},
                                               {TestType::kExact, "exact"}};

struct TestOptions {
  bool on = true;
  int count = 5;
  double ratio = 0.8;
  std::string path = "a \"b\" \\ c";
  std::vector<double> mean = {0.5, 1.0};
  TestType type = TestType::kFast;
  std::string experiment = "all";

  void VisitFields(OptionVisitor& v) {
    v.Bool("on", on, "");
    v.Int("count", count, {0, 10}, "");
    v.Double("ratio", ratio, {0.0, 1.0}, "");
    v.String("path", path, "");
    v.Doubles("mean", mean, "");
    v.Choice("type", type, kTestTypes, "");
    v.Choice("experiment", experiment, {"all", "noise"}, "");
  }
};

std::string ValidationError(const TestOptions& options) {
  return ThrownMessage<ConfigError>([&] { ValidateOptions(options, "test"); });
}

TEST(Options, DefaultsAreValidAndDumpAsToml) {
  EXPECT_EQ(ValidationError({}), "no error");
  EXPECT_EQ(DumpOptions(TestOptions{}),
            "on = true\ncount = 5\nratio = 0.8\npath = \"a \\\"b\\\" \\\\ c\"\n"
            "mean = [0.5, 1.0]\ntype = \"fast\"\nexperiment = \"all\"\n");
}

TEST(Options, ErrorsNameTheKeyTheValueAndWhatIsAllowed) {
  TestOptions options;
  options.count = 11;
  EXPECT_EQ(ValidationError(options), "test.count: 11 is out of range [0, 10]");
  options = {};
  options.ratio = -0.5;
  EXPECT_EQ(ValidationError(options), "test.ratio: -0.5 is out of range [0.0, 1.0]");
  options = {};
  options.ratio = std::nan("");
  EXPECT_NE(ValidationError(options), "no error");
  options = {};
  options.type = static_cast<TestType>(7);
  EXPECT_EQ(ValidationError(options), "test.type: '' is not one of fast, exact");
  options = {};
  options.experiment = "al";
  EXPECT_EQ(ValidationError(options), "test.experiment: 'al' is not one of all, noise");
  options = {};
  options.mean = {1.0, std::nan("")};
  EXPECT_NE(ValidationError(options), "no error");
}

// TOML forbids raw control characters in strings.
TEST(Options, DumpEscapesControlCharacters) {
  TestOptions options;
  options.path = "line\nbreak\ttab\x01";
  EXPECT_NE(DumpOptions(options).find("path = \"line\\nbreak\\ttab\\u0001\"\n"), std::string::npos);
}

TEST(Options, DumpedNumbersReadBackExactly) {
  for (const double value : {0.1, 1.0 / 3.0, 1e300, 123456789.0, 1e22, -0.0}) {
    TestOptions options;
    options.ratio = value;
    const std::string text = DumpOptions(options);
    const size_t at = text.find("ratio = ") + 8;
    const std::string number = text.substr(at, text.find('\n', at) - at);
    EXPECT_EQ(std::stod(number), value);
    EXPECT_NE(number.find_first_of(".e"), std::string::npos) << number;
  }
}

TEST(Options, NearestNameFindsTyposAndNothingElse) {
  const std::vector<std::string> names = {"max_ratio", "cross_check", "max_num_features"};
  EXPECT_EQ(DidYouMean("max_rato", names), "; did you mean 'max_ratio'?");
  EXPECT_EQ(DidYouMean("crosscheck", names), "; did you mean 'cross_check'?");
  EXPECT_EQ(DidYouMean("max_num_featrues", names), "; did you mean 'max_num_features'?");
  EXPECT_EQ(DidYouMean("colour", names), "");
  EXPECT_EQ(DidYouMean("", names), "");
  EXPECT_EQ(DidYouMean("x", {}), "");
}

// COLMAP's flags, and flags whose module was left out.
TEST(Options, AnOptionOfAnotherModuleIsMeantByItsName) {
  const std::vector<std::string> known = {"--single_camera",        "--features.max_num_features",
                                          "--matching.max_ratio",   "--pair_selection.overlap",
                                          "--a_module.shared_name", "--b_module.shared_name"};
  const auto describe = [&](const std::string& key) { return DescribeUnknownOption(key, known); };
  EXPECT_EQ(describe("--SiftExtraction.max_num_features"),
            "'--SiftExtraction.max_num_features'; did you mean '--features.max_num_features'?");
  EXPECT_EQ(describe("--ImageReader.single_camera"),
            "'--ImageReader.single_camera'; did you mean '--single_camera'?");
  EXPECT_EQ(describe("--max_ratio"), "'--max_ratio'; did you mean '--matching.max_ratio'?");
  EXPECT_EQ(describe("--overlap"), "'--overlap'; did you mean '--pair_selection.overlap'?");
  EXPECT_EQ(describe("--shared_name"),
            "'--shared_name'; did you mean '--a_module.shared_name' or '--b_module.shared_name'?");
  EXPECT_EQ(describe("--c_module.shared_name"),
            "'--c_module.shared_name'; did you mean '--a_module.shared_name'?");
  EXPECT_EQ(describe("--matching.max_rato"),
            "'--matching.max_rato'; did you mean '--matching.max_ratio'?");
  EXPECT_EQ(describe("--Mapper.num_threads"), "'--Mapper.num_threads'");
  EXPECT_EQ(DescribeUnknownOption("overlap", {"pair_selection.overlap"}),
            "'overlap'; did you mean 'pair_selection.overlap'?");
}

TEST(Options, AListOfPhotographsIsNoFolder) {
  EXPECT_EQ(DescribeUnknownOption("--image_list_path", {"--image_path"}),
            "'--image_list_path': all photographs of image_path and its sub-folders are taken; put "
            "links to those of the list into a folder of their own");
}

}  // namespace
}  // namespace cairn
