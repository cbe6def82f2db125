#pragma once

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/run_context.h"
#include "cairn/base/types.h"

namespace cairn {

// A measured relative rotation x_2 = cam2_from_cam1 x_1. The two ids may come in any order; several
// edges may join the same two images.
struct RotationEdge {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  Eigen::Quaterniond cam2_from_cam1 = Eigen::Quaterniond::Identity();
  // Trust, > 0: number of inliers, or 1. It decides the spanning tree, and enters the cost raised
  // to `weight_power`.
  double weight = 1.0;
};

struct RotationAveragingOptions {
  int max_l1_iterations = 5;
  int max_consensus_rounds = 8;
  int max_region_rounds = 30;
  int max_irls_iterations = 60;
  double sigma_start_deg = 5.0;
  double sigma_end_deg = 1.0;
  double sigma_decay = 0.8;
  double convergence_deg = 1e-3;
  double max_error_deg = 10.0;
  double weight_power = 0.0;

  void VisitFields(OptionVisitor& v) {
    v.Int("max_l1_iterations", max_l1_iterations, {0, 1000},
          "outer iterations of the L1 stage (ADMM); 0 skips it");
    v.Int("max_consensus_rounds", max_consensus_rounds, {0, 1000},
          "rounds in which single cameras may jump to the rotation that most of their edges agree "
          "on; 0 skips them");
    v.Int(
        "max_region_rounds", max_region_rounds, {0, 1000},
        "rounds in which regions of cameras may turn as one, where more edges agree then; 0: none");
    v.Int("max_irls_iterations", max_irls_iterations, {0, 1000},
          "iterations of the reweighted least-squares stage; 0 skips it");
    v.Double("sigma_start_deg", sigma_start_deg, {1e-6, 180},
             "scale of the robust kernel at the start, degrees");
    v.Double("sigma_end_deg", sigma_end_deg, {1e-6, 180},
             "scale of the robust kernel at the end, degrees");
    v.Double("sigma_decay", sigma_decay, {0.01, 0.999},
             "factor of the kernel's scale from one iteration to the next");
    v.Double("convergence_deg", convergence_deg, {0, 10},
             "stop when the mean update of a camera falls below this, degrees");
    v.Double("max_error_deg", max_error_deg, {0, 180},
             "an edge that ends with a larger residual is reported as rejected, degrees");
    v.Double("weight_power", weight_power, {0, 2},
             "an edge counts as its weight to this power; 0: all alike (reconstruct tries 1 and 0, "
             "too)");
  }
};

enum class RotationAveragingStatus {
  kSuccess,
  kNoEdges,       // nothing to average
  kNotConverged,  // iterations were used up; the rotations are the last ones
  kInterrupted,   // the monitor asked to stop; no rotations
};
std::string_view RotationAveragingStatusName(RotationAveragingStatus status);

struct RotationAveragingReport {
  RotationAveragingStatus status = RotationAveragingStatus::kNoEdges;
  // Of every image that has an edge. Each component has a frame of its own, which means nothing.
  std::map<image_t, Eigen::Quaterniond> cam_from_world;
  // Image ids of each connected component, sorted; the largest component first.
  std::vector<std::vector<image_t>> components;
  // One an input edge, in the order of the input: angle of cam2_from_cam1^-1 R_2 R_1^T, degrees.
  std::vector<double> edge_residuals_deg;
  std::vector<char> edge_rejected;  // residual > max_error_deg
  int num_rejected = 0;
  int num_l1_iterations = 0;
  int num_irls_iterations = 0;
  double median_residual_deg = 0;
};

// Global rotations from relative ones: maximum spanning tree; L1 by ADMM; iteratively reweighted
// least squares with the kernel's scale annealed (Chatterjee and Govindu, "Efficient and Robust
// Large-Scale Rotation Averaging", 2013; "Robust Relative Rotation Averaging", 2018). Every step
// solves three right-hand sides with the n x n weighted Laplacian and updates on the manifold.
// Between the two, cameras in a wrong local minimum are moved by a vote of their edges: single
// ones, and regions as one. The result does not depend on the order of the edges or on the number
// of threads.
RotationAveragingReport AverageRotations(std::span<const RotationEdge> edges,
                                         const RotationAveragingOptions& options = {},
                                         const RunContext& run = {});

// The same, more than once over the same edges: what the edges alone decide is computed once.
class RotationAverager {
 public:
  explicit RotationAverager(std::span<const RotationEdge> edges, const RunContext& run = {});
  ~RotationAverager();

  RotationAveragingReport Average(const RotationAveragingOptions& options = {});
  // From these rotations of all images that have an edge, without spanning tree and L1.
  RotationAveragingReport AverageFrom(const std::map<image_t, Eigen::Quaterniond>& start,
                                      const RotationAveragingOptions& options = {});

 private:
  struct Prepared;
  RotationAveragingReport Run(std::vector<Eigen::Quaterniond> cam_from_world, bool from_tree,
                              const RotationAveragingOptions& options);

  const std::unique_ptr<Prepared> prepared_;
  const RunContext run_;
};

}  // namespace cairn
