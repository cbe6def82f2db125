#include "relative_pose_experiments/noise.h"

#include <algorithm>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "relative_pose_experiments/statistics.h"

namespace cairn::experiments {
namespace {

constexpr int kNumLevels = 11;  // from zero
constexpr NoiseLevels kLargest = {.image_px = 2.5, .affine = 0.2, .depth = 0.2};
// Good features and good depth: half a pixel, 5 %.
constexpr NoiseLevels kRealistic = {.image_px = 0.5, .affine = 0.05, .depth = 0.05};

const std::vector<std::string> kKinds = {"image", "affine", "depth"};

double& LevelOf(NoiseLevels& levels, const std::string& kind) {
  if (kind == "image") return levels.image_px;
  if (kind == "affine") return levels.affine;
  CAIRN_CHECK(kind == "depth");
  return levels.depth;
}

NoiseLevels WithLevel(NoiseLevels levels, const std::string& kind, int step) {
  NoiseLevels largest = kLargest;
  LevelOf(levels, kind) = LevelOf(largest, kind) * step / (kNumLevels - 1);
  return levels;
}

NoiseFigures FiguresOf(Solver solver, const NoiseLevels& levels, std::vector<double> rotation,
                       std::vector<double> translation, double share_without_model) {
  return {.solver = solver,
          .levels = levels,
          .rotation_median_deg = Median(rotation),
          .rotation_mean_deg = Mean(rotation),
          .translation_median_deg = Median(translation),
          .translation_mean_deg = Mean(translation),
          .share_without_model = share_without_model};
}

class NoiseRunner {
 public:
  NoiseRunner(const std::vector<Instance>& instances, uint64_t seed, int num_threads,
              ProgressMonitor& monitor)
      : instances_(instances), seed_(seed), num_threads_(num_threads), monitor_(monitor) {}

  // Appends one element a solver. After a stop was asked for, nothing.
  void Run(const NoiseLevels& levels, const std::vector<Solver>& solvers,
           std::vector<NoiseFigures>* figures) {
    if (monitor_.StopRequested()) return;
    const auto n = static_cast<int64_t>(instances_.size());
    std::vector<std::vector<std::optional<PoseErrors>>> errors(
        solvers.size(), std::vector<std::optional<PoseErrors>>(n));
    ParallelFor(
        num_threads_, n,
        [&](int64_t i) {
          const Instance noisy = WithNoise(instances_[i], levels, seed_, i);
          for (size_t s = 0; s < solvers.size(); ++s) {
            if (const auto pose = EstimatePose(solvers[s], noisy)) {
              errors[s][i] = ErrorsOf(*pose, instances_[i]);
            }
          }
        },
        64);
    for (size_t s = 0; s < solvers.size(); ++s) {
      std::vector<double> rotation, translation;
      int64_t num_without_model = 0;
      for (const auto& e : errors[s]) {
        num_without_model += !e;
        rotation.push_back(e.value_or(PoseErrors()).rotation_deg);
        translation.push_back(e.value_or(PoseErrors()).translation_deg);
      }
      figures->push_back(FiguresOf(solvers[s], levels, rotation, translation,
                                   static_cast<double>(num_without_model) / n));
    }
    monitor_.Advance(1);
  }

 private:
  const std::vector<Instance>& instances_;
  const uint64_t seed_;
  const int num_threads_;
  ProgressMonitor& monitor_;
};

NoiseHeatMap RunHeatMap(Solver solver, const std::string& vertical, NoiseRunner& runner) {
  NoiseHeatMap map{.solver = solver, .vertical = vertical};
  for (int y = 0; y < kNumLevels; ++y) {
    for (int x = 0; x < kNumLevels; ++x) {
      runner.Run(WithLevel(WithLevel({}, vertical, y), "image", x), {solver}, &map.figures);
    }
  }
  return map;
}

double MedianAt(const NoiseReport& report, const std::string& setup, const std::string& varied,
                Solver solver, int step) {
  for (const NoiseCurve& curve : report.curves) {
    if (curve.setup == setup && curve.varied == varied) {
      return curve.figures.at(step * kNumSolvers + static_cast<int>(solver)).rotation_median_deg;
    }
  }
  return -1.0;
}

}  // namespace

NoiseReport RunNoise(const std::vector<Instance>& instances, uint64_t seed, int num_threads,
                     ProgressMonitor& monitor) {
  NoiseRunner runner(instances, seed, num_threads, monitor);
  NoiseReport report;
  const std::vector<Solver> solvers(kAllSolvers.begin(), kAllSolvers.end());
  monitor.BeginStage("noise curves", 2 * 3 * kNumLevels);
  for (const bool together : {false, true}) {
    for (const std::string& kind : kKinds) {
      NoiseCurve curve{.setup = together ? "together" : "alone", .varied = kind};
      for (int step = 0; step < kNumLevels; ++step) {
        runner.Run(WithLevel(together ? kRealistic : NoiseLevels(), kind, step), solvers,
                   &curve.figures);
      }
      report.curves.push_back(std::move(curve));
    }
  }
  monitor.EndStage();
  monitor.BeginStage("noise heat maps", 3 * kNumLevels * kNumLevels);
  report.heat_maps.push_back(RunHeatMap(Solver::kProposed, "affine", runner));
  report.heat_maps.push_back(RunHeatMap(Solver::kProposed, "depth", runner));
  report.heat_maps.push_back(RunHeatMap(Solver::kFivePoint, "depth", runner));
  monitor.EndStage();
  return report;
}

Table CurveTable(const NoiseReport& report) {
  Table table;
  for (const NoiseCurve& curve : report.curves) {
    for (const NoiseFigures& f : curve.figures) {
      table.AddRow({{"setup", curve.setup},
                    {"varied", curve.varied},
                    {"image_px", f.levels.image_px},
                    {"affine", f.levels.affine},
                    {"depth", f.levels.depth},
                    {"solver", SolverName(f.solver)},
                    {"rotation_median_deg", f.rotation_median_deg},
                    {"rotation_mean_deg", f.rotation_mean_deg},
                    {"translation_median_deg", f.translation_median_deg},
                    {"translation_mean_deg", f.translation_mean_deg},
                    {"share_without_model", f.share_without_model}});
    }
  }
  return table;
}

Table HeatMapTable(const NoiseReport& report) {
  Table table;
  for (const NoiseHeatMap& map : report.heat_maps) {
    for (const NoiseFigures& f : map.figures) {
      table.AddRow({{"solver", SolverName(map.solver)},
                    {"vertical", map.vertical},
                    {"image_px", f.levels.image_px},
                    {"affine", f.levels.affine},
                    {"depth", f.levels.depth},
                    {"rotation_median_deg", f.rotation_median_deg},
                    {"rotation_mean_deg", f.rotation_mean_deg}});
    }
  }
  return table;
}

std::vector<FigureCheck> Checks(const NoiseReport& report) {
  const auto at = [&](const char* setup, const char* varied, Solver solver, int step) {
    return MedianAt(report, setup, varied, solver, step);
  };
  const int last = kNumLevels - 1;
  const double five_point = at("alone", "image", Solver::kFivePoint, last);
  const double proposed = at("alone", "image", Solver::kProposed, last);
  return {
      // 1AC+D hardly feels image noise, less than the five points do.
      {"noise.image.5PT_median_deg", five_point, 0.3, 5},
      {"noise.image.1AC+D_median_deg", proposed, 0.01, 1},
      {"noise.image.1AC+D_over_5PT", proposed / five_point, 0, 1},
      // The five points do not know of frames and depth.
      {"noise.affine.5PT_median_deg", at("alone", "affine", Solver::kFivePoint, last), 0, 1e-9},
      {"noise.depth.5PT_median_deg", at("alone", "depth", Solver::kFivePoint, last), 0, 1e-9},
      {"noise.depth.2AC_median_deg", at("alone", "depth", Solver::kTwoAffine, last), 0, 1e-9},
      // Noise of 20 % costs degrees, not tens of degrees.
      {"noise.affine.1AC+D_median_deg", at("alone", "affine", Solver::kProposed, last), 2, 40},
      {"noise.depth.1AC+D_median_deg", at("alone", "depth", Solver::kProposed, last), 2, 40},
      {"noise.together.1AC+D_median_deg", at("together", "image", Solver::kProposed, 0), 0.5, 15},
  };
}

}  // namespace cairn::experiments
