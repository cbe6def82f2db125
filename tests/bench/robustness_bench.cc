// Success of verifiers on synthetic pairs by share of outliers and noise: percent of seeds whose
// pose is within 2 degrees. A mark (!) stands where the cascade is below five points.
//   robustness_bench [--num_seeds 100] [--layout relief] [--verifier cascade,five_point]
#include <algorithm>
#include <cstdio>
#include <sstream>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "cairn/two_view/pair_verifier.h"
#include "common/program.h"
#include "support/two_view_problem.h"

namespace cairn::bench {
namespace {

struct BenchOptions {
  int num_seeds = 100;
  int first_seed = 0;
  int num_matches = 300;
  int num_threads = 1;
  std::string layout = "relief";
  std::string verifier = "one_ac_depth,fast,cascade,five_point";

  void VisitFields(OptionVisitor& v) {
    v.Int("num_seeds", num_seeds, {1, 100000}, "problems a cell");
    v.Int("first_seed", first_seed, {0, 1000000}, "of the problems");
    v.Int("num_matches", num_matches, {20, 100000}, "of a problem, with the outliers");
    v.Int("num_threads", num_threads, {0, 1024}, "threads");
    v.Choice("layout", layout, {"paper", "relief"},
             "points without order and random normals as in the paper, or a rough wall");
    v.String("verifier", verifier, "names, separated by commas");
  }
};

struct Axis {
  const char* name;
  std::vector<double> values;
  void (*set)(double, ObservationNoise*);
};

// What is not varied has this noise.
ObservationNoise UsualNoise() {
  ObservationNoise noise;
  noise.image_px = 0.5;
  noise.affine = 0.05;
  noise.depth = 0.05;
  noise.depth_gradient = 0.1;
  return noise;
}

const Axis kAxes[] = {
    {"image noise, px", {0, 0.5, 1, 2.5}, [](double v, ObservationNoise* n) { n->image_px = v; }},
    {"depth noise, %", {0, 5, 20}, [](double v, ObservationNoise* n) { n->depth = 0.01 * v; }},
    {"affine noise, %", {0, 10, 30}, [](double v, ObservationNoise* n) { n->affine = 0.01 * v; }},
};
constexpr double kOutlierRatios[] = {0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95};

bool Succeeds(const TwoViewProblem& problem, int seed, PairVerifier& verifier) {
  PairInput input;
  input.pair_id = ImagePairToPairId(1, 2);
  input.seed = static_cast<uint64_t>(seed);
  input.camera1 = &problem.camera1;
  input.camera2 = &problem.camera2;
  input.keypoints1 = problem.keypoints1;
  input.keypoints2 = problem.keypoints2;
  input.depth1 = problem.depth1;
  input.depth2 = problem.depth2;
  // In an order that does not tell which are right.
  FeatureMatches matches = problem.matches;
  std::sort(matches.begin(), matches.end(),
            [](const FeatureMatch& a, const FeatureMatch& b) { return a.point1 < b.point1; });
  input.matches = matches;
  const PairReport report = verifier.Verify(input);
  if (report.status != PairStatus::kVerified || !report.geometry.cam2_from_cam1) return false;
  const Rigid3d& pose = *report.geometry.cam2_from_cam1;
  const double error = std::max(AngleBetween(pose.rotation, problem.cam2_from_cam1.rotation),
                                AngleBetween(pose.translation, problem.cam2_from_cam1.translation));
  return error < DegToRad(2.0);
}

std::vector<int> CountSuccesses(const BenchOptions& options,
                                const std::vector<VerifierKind>& verifiers,
                                const TwoViewOptions& verification, double outlier_ratio,
                                const ObservationNoise& noise) {
  std::vector<std::vector<char>> succeeds(options.num_seeds);
  ParallelFor(options.num_threads, options.num_seeds, [&](int64_t seed) {
    TwoViewProblemOptions problem_options;
    problem_options.layout =
        options.layout == "paper" ? TwoViewLayout::kPaper : TwoViewLayout::kRelief;
    problem_options.num_matches = options.num_matches;
    problem_options.outlier_ratio = outlier_ratio;
    problem_options.noise = noise;
    problem_options.depth2_scale = 1.7;
    const TwoViewProblem problem =
        MakeTwoViewProblem(problem_options, static_cast<uint64_t>(options.first_seed + seed));
    for (const VerifierKind kind : verifiers) {
      const auto verifier = MakePairVerifier(kind, verification);
      succeeds[seed].push_back(Succeeds(problem, static_cast<int>(seed), *verifier));
    }
  });
  std::vector<int> counts(verifiers.size(), 0);
  for (const auto& row : succeeds) {
    for (size_t k = 0; k < row.size(); ++k) counts[k] += row[k];
  }
  return counts;
}

int Run(const BenchOptions& options, const TwoViewOptions& verification) {
  std::vector<VerifierKind> verifiers;
  std::stringstream names(options.verifier);
  for (std::string name; std::getline(names, name, ',');) {
    verifiers.push_back(VerifierKindFromName(name));
  }
  int num_below = 0;
  for (const Axis& axis : kAxes) {
    std::printf("%-22s outliers, %%:", axis.name);
    for (const double ratio : kOutlierRatios) std::printf("%6.0f", 100.0 * ratio);
    std::printf("\n");
    for (const double value : axis.values) {
      ObservationNoise noise = UsualNoise();
      axis.set(value, &noise);
      std::vector<std::vector<int>> cells;
      for (const double ratio : kOutlierRatios) {
        cells.push_back(CountSuccesses(options, verifiers, verification, ratio, noise));
      }
      for (size_t k = 0; k < verifiers.size(); ++k) {
        std::printf("%8g  %-26s", value, std::string(VerifierKindName(verifiers[k])).c_str());
        for (const auto& cell : cells) {
          const bool is_below = verifiers[k] == VerifierKind::kCascade &&
                                verifiers.back() == VerifierKind::kFivePoint &&
                                cell[k] < cell.back();
          num_below += is_below;
          std::printf(" %4.0f%c", 100.0 * cell[k] / options.num_seeds, is_below ? '!' : ' ');
        }
        std::printf("\n");
        std::fflush(stdout);
      }
    }
  }
  std::printf("cells where the cascade is below five points: %d\n", num_below);
  return 0;
}

}  // namespace
}  // namespace cairn::bench

int main(int argc, char** argv) {
  using namespace cairn;
  return RunMain([&] {
    Program program("robustness_bench", "Success of verifiers by outliers and noise");
    bench::BenchOptions options;
    Command& command = program.MainCommand();
    TwoViewOptions verification;
    command.AddOptions("", options);
    command.AddOptions("verification", verification);
    command.SetRun([&] { return bench::Run(options, verification); });
    return program.Run(argc, argv);
  });
}
