#include "relative_pose_experiments/noise.h"

#include <map>
#include <span>
#include <string_view>
#include <tuple>

#include "cairn/base/parallel.h"
#include "relative_pose_experiments/solver_runs.h"
#include "relative_pose_experiments/statistics.h"

namespace cairn::experiments {
namespace {

constexpr int kNumLevels = 11;  // from zero
// Good features and good depth: half a pixel, 5 %.
constexpr NoiseLevels kRealistic = {.image_px = 0.5, .affine = 0.05, .depth = 0.05};

struct Kind {
  std::string_view name;
  double NoiseLevels::*level;
  double largest;
};
constexpr Kind kImage = {"image", &NoiseLevels::image_px, 2.5};
constexpr Kind kAffine = {"affine", &NoiseLevels::affine, 0.2};
constexpr Kind kDepth = {"depth", &NoiseLevels::depth, 0.2};

NoiseLevels WithLevel(NoiseLevels levels, const Kind& kind, int step) {
  levels.*kind.level = kind.largest * step / (kNumLevels - 1);
  return levels;
}

struct NoiseFigures {
  double rotation_median_deg, rotation_mean_deg;
  double translation_median_deg, translation_mean_deg;
  double share_without_model;
};

struct NoiseRun {
  const std::vector<Instance>& instances;
  uint64_t seed;
  int num_threads;
  ProgressMonitor& monitor;
};

// One element a solver.
std::vector<NoiseFigures> Measure(const NoiseRun& run, const NoiseLevels& levels,
                                  std::span<const Solver> solvers) {
  const auto n = static_cast<int64_t>(run.instances.size());
  std::vector<std::vector<std::optional<PoseErrors>>> errors(
      solvers.size(), std::vector<std::optional<PoseErrors>>(n));
  ParallelFor(
      run.num_threads, n,
      [&](int64_t i) {
        const Instance noisy = WithNoise(run.instances[i], levels, run.seed, i);
        for (size_t s = 0; s < solvers.size(); ++s) {
          if (const auto pose = EstimatePose(solvers[s], noisy)) {
            errors[s][i] = ErrorsOf(*pose, noisy.cam2_from_cam1);
          }
        }
      },
      64);
  run.monitor.Advance(1);
  std::vector<NoiseFigures> figures;
  for (const auto& of_solver : errors) {
    std::vector<double> rotation, translation;
    int64_t num_without_model = 0;
    for (const auto& e : of_solver) {
      num_without_model += !e;
      rotation.push_back(e.value_or(PoseErrors()).rotation_deg);
      translation.push_back(e.value_or(PoseErrors()).translation_deg);
    }
    figures.push_back({Median(rotation), Mean(rotation), Median(translation), Mean(translation),
                       static_cast<double>(num_without_model) / n});
  }
  return figures;
}

// Median rotation errors, degrees, by (the others are not zero, kind that varies, level, solver).
using Medians = std::map<std::tuple<bool, std::string_view, int, Solver>, double>;

Medians RunCurves(const NoiseRun& run, Table& table) {
  Medians medians;
  run.monitor.BeginStage("noise curves", 2 * 3 * kNumLevels);
  for (const bool together : {false, true}) {
    for (const Kind& kind : {kImage, kAffine, kDepth}) {
      for (int step = 0; step < kNumLevels && !run.monitor.StopRequested(); ++step) {
        const NoiseLevels levels = WithLevel(together ? kRealistic : NoiseLevels(), kind, step);
        const auto figures = Measure(run, levels, kAllSolvers);
        for (const Solver solver : kAllSolvers) {
          const NoiseFigures& f = figures[static_cast<int>(solver)];
          medians[{together, kind.name, step, solver}] = f.rotation_median_deg;
          table.AddRow({{"setup", together ? "together" : "alone"},
                        {"varied", kind.name},
                        {"image_px", levels.image_px},
                        {"affine", levels.affine},
                        {"depth", levels.depth},
                        {"solver", SolverName(solver)},
                        {"rotation_median_deg", f.rotation_median_deg},
                        {"rotation_mean_deg", f.rotation_mean_deg},
                        {"translation_median_deg", f.translation_median_deg},
                        {"translation_mean_deg", f.translation_mean_deg},
                        {"share_without_model", f.share_without_model}});
        }
      }
    }
  }
  run.monitor.EndStage();
  return medians;
}

void RunHeatMaps(const NoiseRun& run, Table& table) {
  run.monitor.BeginStage("noise heat maps", 3 * kNumLevels * kNumLevels);
  for (const auto& [solver, kind] :
       {std::pair(Solver::kProposed, kAffine), std::pair(Solver::kProposed, kDepth),
        std::pair(Solver::kFivePoint, kDepth)}) {
    for (int y = 0; y < kNumLevels; ++y) {
      for (int x = 0; x < kNumLevels && !run.monitor.StopRequested(); ++x) {
        const NoiseLevels levels = WithLevel(WithLevel({}, kind, y), kImage, x);
        const NoiseFigures f = Measure(run, levels, {&solver, 1}).front();
        table.AddRow({{"solver", SolverName(solver)},
                      {"vertical", kind.name},
                      {"image_px", levels.image_px},
                      {"affine", levels.affine},
                      {"depth", levels.depth},
                      {"rotation_median_deg", f.rotation_median_deg},
                      {"rotation_mean_deg", f.rotation_mean_deg}});
      }
    }
  }
  run.monitor.EndStage();
}

std::vector<FigureCheck> Checks(const Medians& medians) {
  const auto largest = [&](const char* kind, Solver solver) {
    return medians.at({false, kind, kNumLevels - 1, solver});
  };
  const double five_point = largest("image", Solver::kFivePoint);
  const double proposed = largest("image", Solver::kProposed);
  return {
      // 1AC+D hardly feels image noise, less than the five points do.
      {"noise.image.5PT_median_deg", five_point, 0.3, 5},
      {"noise.image.1AC+D_median_deg", proposed, 0.01, 1},
      {"noise.image.1AC+D_over_5PT", proposed / five_point, 0, 1},
      // The five points do not know of frames and depth.
      {"noise.affine.5PT_median_deg", largest("affine", Solver::kFivePoint), 0, 1e-9},
      {"noise.depth.5PT_median_deg", largest("depth", Solver::kFivePoint), 0, 1e-9},
      {"noise.depth.2AC_median_deg", largest("depth", Solver::kTwoAffine), 0, 1e-9},
      // Noise of 20 % costs degrees, not tens of degrees.
      {"noise.affine.1AC+D_median_deg", largest("affine", Solver::kProposed), 2, 40},
      {"noise.depth.1AC+D_median_deg", largest("depth", Solver::kProposed), 2, 40},
      {"noise.together.1AC+D_median_deg", medians.at({true, "image", 0, Solver::kProposed}), 0.5,
       15},
  };
}

}  // namespace

Results RunNoise(const std::vector<Instance>& instances, uint64_t seed, int num_threads,
                 ProgressMonitor& monitor) {
  const NoiseRun run{instances, seed, num_threads, monitor};
  Results results;
  const Medians medians = RunCurves(run, results.tables["noise_curves"]);
  RunHeatMaps(run, results.tables["noise_heat_maps"]);
  if (monitor.StopRequested()) return {};
  results.checks = Checks(medians);
  return results;
}

}  // namespace cairn::experiments
