#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "relative_pose_experiments/solver_runs.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

// One solver's errors over instances without noise, those without a model left out.
struct StabilityFigures {
  std::string solver;
  std::vector<double> sampson_px = {}, rotation_deg = {}, translation_deg = {};
  int64_t num_without_model = 0;
};

// Of any function from an instance to cam2_from_cam1.
using PoseEstimator = std::function<std::optional<Rigid3d>(const Instance&)>;
StabilityFigures MeasureStability(std::string solver, const PoseEstimator& estimate,
                                  const std::vector<Instance>& instances, int num_threads);
std::vector<FigureCheck> Checks(const StabilityFigures& figures);

// Of all solvers: the paper's Figure 3, with histograms of log10 of the three errors.
Results RunStability(const std::vector<Instance>& instances, int num_threads);

}  // namespace cairn::experiments
