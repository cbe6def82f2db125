#pragma once

#include <string>
#include <vector>

#include "cairn/base/progress.h"
#include "cairn/evaluation/pose_evaluation.h"
#include "cairn/two_view/options.h"
#include "relative_pose_experiments/real_scene.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

// A row of the paper's Table 2.
struct ReconstructionResult {
  std::string verifier;       // as --verifier of build_view_graph
  std::string failure;        // of the reconstruction, else ""
  PoseEvaluation evaluation;  // of the largest model
  int num_verified_pairs = 0;
  double verification_seconds = 0;
  double reconstruction_seconds = 0;  // given the view graph; the least of three runs
};

struct ReconstructionSettings {
  std::vector<std::string> verifiers;
  TwoViewOptions verification;
  bool refine_intrinsics = true;
  std::string work_path;  // folder for databases that do not stay
  uint64_t seed = 0;
  int num_threads = 0;  // of verification; reconstruction has one
};

// For each verifier: a database with the features and matches of options.database_path and the
// depth of the given source (depth_path, depth_model, else the database's own) is made, its pairs
// are verified, and it is reconstructed and compared with the reference. Throws ConfigError for an
// unknown verifier, IoError.
std::vector<ReconstructionResult> RunReconstructions(const RealDataOptions& options,
                                                     const DepthOptions& depth_options,
                                                     const ReconstructionSettings& settings,
                                                     ProgressMonitor& monitor);

// The paper's layout: orientation in degrees, position in the reference's unit, focal length in
// 0.01 of itself, each AVG, MED, STD.
Table ReconstructionTable(const std::vector<ReconstructionResult>& results,
                          const RealDataOptions& data);
Table ReconstructionTimeTable(const std::vector<ReconstructionResult>& results,
                              const RealDataOptions& data);
// For the synthetic scene.
std::vector<FigureCheck> Checks(const std::vector<ReconstructionResult>& results);

}  // namespace cairn::experiments
