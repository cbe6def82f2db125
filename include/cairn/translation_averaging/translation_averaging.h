#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/base/types.h"
#include "cairn/translation_averaging/options.h"

namespace cairn {

// A measured direction between two camera centers, in the world frame: c_2 - c_1 points along
// `direction` (need not be normalized; not zero). With known rotations, it is
// R_2^T * -t for the pose cam2_from_cam1 = (R, t) and the global rotation R_2 = cam2_from_world.
struct DirectionEdge {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  // |c_2 - c_1| in a unit that all edges share; 0: not known.
  double length = 0;
  // How many points both cameras see by rays that are not parallel: what the edge counts beside
  // others; 0: not known.
  int num_points = 0;
};

// A viewing ray from a camera center to a scene point, in the world frame.
struct PointRay {
  image_t image_id = kInvalidImageId;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

// The rays of all observations of one scene point (a track); at most one an image.
struct PointDirections {
  std::vector<PointRay> rays;
};

// What is known beforehand of a camera center, by GPS for one.
struct CenterPrior {
  image_t image_id = kInvalidImageId;
  Eigen::Vector3d center;
  Eigen::Matrix3d information;  // inverse covariance; singular where an axis is not known
};
// Priors in the frame of these centers, which are what the directions alone give, and whose place,
// orientation and scale mean nothing.
using CenterPriors =
    std::function<std::vector<CenterPrior>(const std::map<image_t, Eigen::Vector3d>& centers)>;

enum class TranslationAveragingStatus {
  kSuccess,
  kNoEdges,       // no two cameras that directions join (see not_rigid)
  kInconsistent,  // the solution contradicts most of the directions: no centers
  kInterrupted,   // the monitor asked to stop: no centers
};
std::string_view TranslationAveragingStatusName(TranslationAveragingStatus status);

struct TranslationAveragingReport {
  TranslationAveragingStatus status = TranslationAveragingStatus::kNoEdges;
  // Why the result was refused, in words; empty if it was not.
  std::string message;
  // Up to one translation and one positive scale: the mean is zero, the median distance from it 1.
  std::map<image_t, Eigen::Vector3d> centers;
  // Images with measurements that are not in the largest parallel-rigid part. (Those far away from
  // all others, since few directions constrain them, have no center either.)
  std::vector<image_t> not_rigid;
  // One an input edge: whether the 1DSfM filter took it out.
  std::vector<char> edge_is_filtered;
  int num_filtered = 0;
  int num_priors = 0;  // that were used
  int num_iterations = 0;
  bool is_by_lengths = false;        // the start that the edges' lengths give led to the better fit
  double median_edge_error_deg = 0;  // of the edges in use
  double median_ray_error_deg = 0;
};

// Camera centers from directions, with known rotations: outlier filter of 1DSfM
// (Wilson and Snavely 2014); parallel-rigidity check; a deterministic start by least unsquared
// deviations (Ozyesil and Singer 2015); robust nonlinear fit of the chordal error over
// camera-camera and camera-point directions; one more fit with `priors`, where it is given; refusal
// of a solution that contradicts the directions. Rigidity is that of cameras in general positions:
// of cameras on one line, directions without rays to points leave the steps open. Edge and track
// order do not matter, nor does the number of threads.
TranslationAveragingReport AverageTranslations(std::span<const DirectionEdge> edges,
                                               std::span<const PointDirections> tracks,
                                               const TranslationAveragingOptions& options = {},
                                               const RunContext& run = {},
                                               const CenterPriors& priors = {});

}  // namespace cairn
