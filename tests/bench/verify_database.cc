// Verifies every pair of a database in one thread and prints accuracy and time side by side, for
// several sources of depth and several verifiers, OpenCV's among them. README.md has the commands.
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include "bench/opencv_verifier.h"
#include "bench/pair_data.h"
#include "bench/pair_truth.h"
#include "cairn/two_view/pair_verifier.h"
#include "common/program.h"

namespace cairn::bench {
namespace {

struct BenchOptions {
  std::string database_path;
  std::string truth_path;
  std::string depth = "none";
  std::string image_path;
  std::string verifier = "cascade";
  std::string csv;
  std::string only;
  int repeat = 1;
  int min_inliers = 15;
  int seed = 0;

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "keypoints and matches");
    v.String("truth_path", truth_path,
             "true poses: a COLMAP model, or a folder of Strecha's .camera files");
    v.String("depth", depth, "separated by commas: folders of maps, networks (.onnx), none");
    v.String("image_path", image_path, "of networks: <scene>/images/<file> for <scene>_<file>");
    v.String("verifier", verifier,
             "separated by commas: cairn's, opencv_usac_accurate, opencv_usac_magsac");
    v.String("csv", csv, "result of the last line of the table");
    v.String("only", only, "pairs of which both names contain this");
    v.Int("repeat", repeat, {1, 1000}, "times are the smallest of so many runs");
    v.Int("min_inliers", min_inliers, {0, 1e9}, "fewer count as rejected");
    v.Int("seed", seed, {0, 1e9}, "of all random numbers");
  }
};

// Processor time of this thread, seconds: the wall clock also counts the machine's other work.
double ThreadSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

std::vector<std::string> Split(const std::string& list) {
  std::vector<std::string> names;
  std::stringstream stream(list);
  for (std::string name; std::getline(stream, name, ',');) names.push_back(name);
  return names;
}

PairResult MakeResult(const ImageData& image1, const ImageData& image2, int num_matches,
                      const PairReport& report) {
  PairResult result;
  result.name1 = image1.name;
  result.name2 = image2.name;
  result.kind = KindOfPair(image1.name, image2.name);
  result.num_matches = num_matches;
  result.num_iterations = report.num_iterations;
  result.num_inliers = report.num_inliers;
  result.note = std::string(PairStatusName(report.status)) + " " +
                std::string(TwoViewConfigName(report.geometry.config)) + " " +
                std::string(report.verifier);
  if (report.status == PairStatus::kVerified) {
    result.cam2_from_cam1 = report.geometry.cam2_from_cam1;
  }
  return result;
}

std::vector<PairResult> VerifyAll(const PairData& data, const BenchOptions& options,
                                  PairVerifier& verifier) {
  std::vector<PairResult> results;
  for (size_t k = 0; k < data.pairs.size(); ++k) {
    const auto [id1, id2] = PairIdToImagePair(data.pairs[k].first);
    const ImageData& image1 = data.images.at(id1);
    const ImageData& image2 = data.images.at(id2);
    if (image1.name.find(options.only) == std::string::npos ||
        image2.name.find(options.only) == std::string::npos) {
      continue;
    }
    const PairInput input = data.Input(k, static_cast<uint64_t>(options.seed));
    PairReport report;
    double seconds = 1e9;
    for (int round = 0; round < options.repeat; ++round) {
      const double start = ThreadSeconds();
      report = verifier.Verify(input);
      seconds = std::min(seconds, ThreadSeconds() - start);
    }
    results.push_back(MakeResult(image1, image2, static_cast<int>(input.matches.size()), report));
    results.back().seconds = seconds;
  }
  return results;
}

int Run(const BenchOptions& options, const DepthOptions& depth_options,
        const TwoViewOptions& verification) {
  PairData data = ReadPairData(options.database_path);
  const auto truth = ReadTruePoses(options.truth_path);
  std::puts(ScoresHeader().c_str());
  for (const std::string& source : Split(options.depth)) {
    ReadDepth(source, options.image_path, depth_options, &data);
    for (const std::string& name : Split(options.verifier)) {
      std::unique_ptr<PairVerifier> verifier = MakeOpenCvVerifier(name, verification);
      if (!verifier) verifier = MakePairVerifier(VerifierKindFromName(name), verification);
      std::vector<PairResult> results = VerifyAll(data, options, *verifier);
      const Scores scores = ScoreResults(truth, options.min_inliers, &results);
      const std::string label = name + ", " + std::filesystem::path(source).stem().string();
      std::puts(FormatScores(label, scores).c_str());
      std::fflush(stdout);
      if (!options.csv.empty()) WriteCsv(options.csv, results);
    }
  }
  return 0;
}

}  // namespace
}  // namespace cairn::bench

int main(int argc, char** argv) {
  using namespace cairn;
  return RunMain([&] {
    Program program("verify_database", "Measures two-view verification over a database");
    bench::BenchOptions options;
    DepthOptions depth;
    TwoViewOptions verification;
    Command& command = program.MainCommand();
    command.AddOptions("", options);
    command.AddOptions("depth", depth);
    command.AddOptions("verification", verification);
    command.SetRun([&] { return bench::Run(options, depth, verification); });
    return program.Run(argc, argv);
  });
}
