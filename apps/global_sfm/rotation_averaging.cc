#include "cairn/rotation_averaging/rotation_averaging.h"

#include <spdlog/fmt/fmt.h>

#include <filesystem>

#include "cairn/base/error.h"
#include "common/console_monitor.h"
#include "common/run_flags.h"
#include "global_sfm/commands.h"
#include "global_sfm/rotation_files.h"

namespace cairn {
namespace {

struct RotationAveragingFiles : ThreadFlags {
  std::string edges_path;
  std::string output_path;
  void VisitFields(OptionVisitor& v) {
    v.String("edges_path", edges_path,
             "relative rotations, a line each: i j R(9) [weight], R = R_j R_i^T");
    v.String("output_path", output_path, "global rotations, a line each: i R(9)");
    ThreadFlags::VisitFields(v);
  }
};

int Run(const RotationAveragingFiles& files, const RotationAveragingOptions& options) {
  std::error_code ignored;
  if (std::filesystem::equivalent(files.edges_path, files.output_path, ignored)) {
    throw ConfigError("output_path", "is the file of the edges, which would be lost");
  }
  ConsoleMonitor monitor;
  const std::vector<RotationEdge> edges = ReadRelativeRotations(files.edges_path);
  const RotationAveragingReport report = AverageRotations(edges, options, files.Run(monitor));
  if (report.cam_from_world.empty()) {
    monitor.Warning("rotation averaging: no result (" +
                    std::string(RotationAveragingStatusName(report.status)) + ")");
    return kExitNoUsableResult;
  }
  WriteRotations(report.cam_from_world, files.output_path);
  monitor.Info(fmt::format(
      "{} cameras from {} relative rotations ({}, {} + {} iterations): residual median {:.3f} deg, "
      "{} beyond {} deg",
      report.cam_from_world.size(), edges.size(), RotationAveragingStatusName(report.status),
      report.num_l1_iterations, report.num_irls_iterations, report.median_residual_deg,
      report.num_rejected, options.max_error_deg));
  if (report.components.size() > 1) {
    monitor.Warning(
        fmt::format("the graph has {} components; each has a frame of its own, the "
                    "largest one {} cameras",
                    report.components.size(), report.components[0].size()));
  }
  return kExitSuccess;
}

}  // namespace

void AddRotationAveragingCommand(Program& program) {
  Command& command =
      program.AddCommand("rotation_averaging", "Global rotations from a file of relative ones.");
  const auto files = std::make_shared<RotationAveragingFiles>();
  const auto options = std::make_shared<RotationAveragingOptions>();
  command.AddOptions("", *files);
  command.AddOptions("rotation_averaging", *options);
  command.SetRun([&command, files, options] {
    command.Require("edges_path");
    command.Require("output_path");
    return Run(*files, *options);
  });
}

}  // namespace cairn
