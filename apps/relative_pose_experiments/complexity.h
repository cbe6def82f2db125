#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "relative_pose_experiments/solver_runs.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

inline constexpr double kRansacConfidence = 0.99;
inline constexpr std::array<double, 3> kTableOutlierShares = {0.50, 0.75, 0.90};

// Samples that a random sample consensus draws until one is free of outliers with the confidence:
// log(1 - confidence) / log(1 - (1 - outlier_share)^sample_size). Not rounded.
double RansacIterations(double outlier_share, int sample_size,
                        double confidence = kRansacConfidence);

// The paper's Table 1, recounted.
struct SolverCost {
  Solver solver = Solver::kFivePoint;
  int sample_size = 0;
  int paper_operations = 0;      // as the paper's table sums them; 0: not in the paper
  double models_per_sample = 0;  // mean
  // Means, counted on the processor; 0 where that is not possible.
  double counted_operations = 0;
  double counted_divisions_and_roots = 0;  // those among them
  double counted_instructions = 0;
};
struct ComplexityReport {
  std::vector<SolverCost> solvers;  // in the order of kAllSolvers
};
// Operations are counted on the first num_counted instances: slowly, instruction by instruction.
ComplexityReport RunComplexity(uint64_t seed, int num_instances, int num_counted);
Table ToTable(const ComplexityReport& report);
// The paper's Figure 2: iterations and operations against the outlier share.
Table IterationTable(const ComplexityReport& report);
std::vector<FigureCheck> Checks(const ComplexityReport& report);

// Nanoseconds a call, the least of several passes over the instances (one thread).
struct SolverTime {
  Solver solver = Solver::kFivePoint;
  double ns = 0;
};
std::vector<SolverTime> TimeSolvers(uint64_t seed, int64_t num_instances, int num_passes);
Table ToTable(const std::vector<SolverTime>& times);
std::vector<FigureCheck> Checks(const std::vector<SolverTime>& times);

}  // namespace cairn::experiments
