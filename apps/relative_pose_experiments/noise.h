#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/base/progress.h"
#include "relative_pose_experiments/solver_runs.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

// Errors of one solver at one level of noise. An instance without a model counts as 180 degrees.
struct NoiseFigures {
  Solver solver = Solver::kFivePoint;
  NoiseLevels levels;
  double rotation_median_deg = 0, rotation_mean_deg = 0;
  double translation_median_deg = 0, translation_mean_deg = 0;
  double share_without_model = 0;
};

// One curve of the paper's Figure 4: one kind of noise varies ("image", "affine", "depth"), the
// other two are fixed: at zero ("alone"), or at what real data has ("together").
struct NoiseCurve {
  std::string setup;
  std::string varied;
  std::vector<NoiseFigures> figures = {};  // by level, then solver
};
// The paper's Figure 5: rotation errors over two kinds of noise, the third at zero.
struct NoiseHeatMap {
  Solver solver = Solver::kFivePoint;
  std::string vertical;                    // "affine" or "depth"; horizontal is image noise
  std::vector<NoiseFigures> figures = {};  // by vertical level, then horizontal level
};

struct NoiseReport {
  std::vector<NoiseCurve> curves;
  std::vector<NoiseHeatMap> heat_maps;
};
NoiseReport RunNoise(const std::vector<Instance>& instances, uint64_t seed, int num_threads,
                     ProgressMonitor& monitor);
Table CurveTable(const NoiseReport& report);
Table HeatMapTable(const NoiseReport& report);
std::vector<FigureCheck> Checks(const NoiseReport& report);

}  // namespace cairn::experiments
