// Every input of the corpus, and every finding that the fuzzers ever made, through its target.
#include <algorithm>
#include <filesystem>
#include <ostream>

#include "cairn/base/file.h"
#include "cairn/base/timer.h"
#include "fuzz/targets.h"
#include "support/test.h"

namespace cairn::fuzz {
namespace {
namespace fs = std::filesystem;

constexpr double kMaxSeconds = 10;  // of one input

struct NamedTarget {
  const char* name;
  Target run;

  // For the name of the test at ctest, which else shows the addresses of the fields.
  friend void PrintTo(const NamedTarget& target, std::ostream* out) { *out << target.name; }
};
constexpr NamedTarget kTargets[] = {{"Image", FuzzImage},
                                    {"DepthMap", FuzzDepthMap},
                                    {"ColmapBinary", FuzzColmapBinary},
                                    {"ColmapText", FuzzColmapText},
                                    {"Bundler", FuzzBundler},
                                    {"Strecha", FuzzStrecha},
                                    {"OneDsfm", FuzzOneDsfm},
                                    {"RunFolder", FuzzRunFolder},
                                    {"Options", FuzzOptions},
                                    {"Lists", FuzzLists},
                                    {"DatabaseBlobs", FuzzDatabaseBlobs},
                                    {"DatabaseRows", FuzzDatabaseRows},
                                    {"Reconstruct", FuzzReconstruct},
                                    {"VerifyPair", FuzzVerifyPair}};

std::vector<std::string> FilesIn(const std::string& folder) {
  std::vector<std::string> paths;
  if (!fs::exists(folder)) return paths;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

class Replay : public ::testing::TestWithParam<NamedTarget> {};

TEST_P(Replay, CorpusAndRegressions) {
  const std::string folder = CAIRN_SOURCE_DIR "/tests/fuzz/";
  const std::vector<std::string> corpus = FilesIn(folder + "corpus/" + GetParam().name);
  EXPECT_FALSE(corpus.empty());
  std::vector<std::string> paths = FilesIn(folder + "regressions/" + GetParam().name);
  paths.insert(paths.end(), corpus.begin(), corpus.end());
  GetParam().run("");
  for (const std::string& path : paths) {
    SCOPED_TRACE(path);
    const Timer timer;
    EXPECT_NO_THROW(GetParam().run(ReadFile(path)));
    EXPECT_LT(timer.Seconds(), kMaxSeconds);
  }
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Replay, ::testing::ValuesIn(kTargets),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace cairn::fuzz
