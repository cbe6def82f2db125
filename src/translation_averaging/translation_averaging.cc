#include "cairn/translation_averaging/translation_averaging.h"

#include <algorithm>
#include <numeric>

#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "translation_averaging/direction_problem.h"
#include "translation_averaging/nonlinear_fit.h"
#include "translation_averaging/one_dsfm_filter.h"
#include "translation_averaging/position_system.h"
#include "translation_averaging/quality.h"
#include "translation_averaging/rigidity.h"
#include "translation_averaging/start.h"

namespace cairn {
namespace {

// Errors up to this many Huber thresholds count as support of a camera.
constexpr double kSupportFactor = 3.0;
// The noise is at least this: measured errors of few or perfect directions mean little.
constexpr double kMinEdgeNoiseDeg = 0.1;
constexpr double kMinRayNoiseDeg = 0.02;
// Relative decrease of the cost at which a fit ends, before the weights change and after.
constexpr double kCoarseTolerance = 1e-3;
constexpr double kFineTolerance = 1e-5;

// Mean zero, median distance from it 1.
void Normalize(Positions& x) {
  const Eigen::Vector3d center = x.cameras.rowwise().mean();
  x.cameras.colwise() -= center;
  x.points.colwise() -= center;
  std::vector<double> distances(x.cameras.cols());
  for (Eigen::Index i = 0; i < x.cameras.cols(); ++i) distances[i] = x.cameras.col(i).norm();
  const double scale = UpperMedian(distances);
  if (scale <= 0) return;
  x.cameras /= scale;
  x.points /= scale;
}

// Angles of all edges and rays to the solution, degrees.
struct Errors {
  std::vector<double> edges_deg;
  std::vector<double> rays_deg;
};
Errors MeasureErrors(const DirectionProblem& problem, const Positions& x) {
  Errors errors;
  for (const DirectionProblem::Edge& edge : problem.edges) {
    const Eigen::Vector3d D = x.cameras.col(edge.camera2) - x.cameras.col(edge.camera1);
    errors.edges_deg.push_back(RadToDeg(AngleBetween(D, edge.direction)));
  }
  for (int k = 0; k < problem.NumTracks(); ++k) {
    for (const DirectionProblem::Ray& ray : problem.RaysOf(k)) {
      const Eigen::Vector3d D = x.points.col(k) - x.cameras.col(ray.camera);
      errors.rays_deg.push_back(RadToDeg(AngleBetween(D, ray.direction)));
    }
  }
  return errors;
}

// All edges together count as their number, all rays together as point_weight times that.
FitWeights BalancedWeights(const DirectionProblem& problem,
                           const TranslationAveragingOptions& options) {
  FitWeights weights;
  weights.edge_huber_deg = weights.ray_huber_deg = options.huber_deg;
  double total = 0;
  for (const DirectionProblem::Edge& edge : problem.edges) total += edge.weight;
  const double num_edges = static_cast<double>(problem.edges.size());
  for (const DirectionProblem::Edge& edge : problem.edges) {
    weights.edges.push_back(edge.weight * num_edges / total);
  }
  const double num_rays = static_cast<double>(problem.rays.size());
  weights.rays.assign(problem.rays.size(),
                      num_edges > 0 ? options.point_weight * num_edges / num_rays : 1.0);
  return weights;
}

// Tukey's weight of an error, 0 from six standard deviations on; `noise` is the median of errors.
double TukeyWeight(double error, double noise) {
  const double u = error / (6 * noise);
  return u >= 1 ? 0.0 : (1 - u * u) * (1 - u * u);
}

// Edges and rays by what the last fit showed of their precision: inverse variances, gross errors
// out.
FitWeights WeightsFromErrors(const DirectionProblem& problem, const Errors& errors,
                             const TranslationAveragingOptions& options) {
  const double edge_noise = std::max(UpperMedian(errors.edges_deg), kMinEdgeNoiseDeg);
  const double ray_noise = std::max(UpperMedian(errors.rays_deg), kMinRayNoiseDeg);
  FitWeights weights = BalancedWeights(problem, options);
  weights.edge_huber_deg = 2 * edge_noise;
  weights.ray_huber_deg = 2 * ray_noise;
  for (size_t e = 0; e < weights.edges.size(); ++e) {
    weights.edges[e] *= TukeyWeight(errors.edges_deg[e], edge_noise);
  }
  const double ratio = edge_noise / ray_noise;
  for (size_t r = 0; r < weights.rays.size(); ++r) {
    weights.rays[r] = ratio * ratio * TukeyWeight(errors.rays_deg[r], ray_noise);
  }
  return weights;
}

void ReportSupport(const DirectionProblem& problem, const Errors& errors, double max_error_deg,
                   TranslationAveragingReport& report) {
  std::vector<std::vector<double>> of_camera(problem.NumCameras());
  for (size_t e = 0; e < problem.edges.size(); ++e) {
    for (const int camera : {problem.edges[e].camera1, problem.edges[e].camera2}) {
      of_camera[camera].push_back(errors.edges_deg[e]);
      if (errors.edges_deg[e] <= max_error_deg) {
        ++report.support[problem.image_ids[camera]].num_edges;
      }
    }
  }
  for (size_t r = 0; r < problem.rays.size(); ++r) {
    const int camera = problem.rays[r].camera;
    of_camera[camera].push_back(errors.rays_deg[r]);
    if (errors.rays_deg[r] <= max_error_deg) {
      ++report.support[problem.image_ids[camera]].num_points;
    }
  }
  for (int i = 0; i < problem.NumCameras(); ++i) {
    report.support[problem.image_ids[i]].median_error_deg = UpperMedian(of_camera[i]);
  }
}

// Centers, support, points and errors in the order of the input.
void FillReport(const DirectionProblem& whole, const DirectionSubproblem& part, const Positions& x,
                const TranslationAveragingOptions& options, TranslationAveragingReport& report) {
  const DirectionProblem& problem = part.problem;
  const Errors errors = MeasureErrors(problem, x);
  for (int i = 0; i < problem.NumCameras(); ++i) {
    report.centers[problem.image_ids[i]] = x.cameras.col(i);
  }
  ReportSupport(problem, errors, kSupportFactor * options.huber_deg, report);

  std::vector<int> part_track(whole.NumTracks(), -1);
  for (size_t k = 0; k < part.track_of.size(); ++k)
    part_track[part.track_of[k]] = static_cast<int>(k);
  for (size_t input = 0; input < whole.track_of_input.size(); ++input) {
    const int track = whole.track_of_input[input];
    const int k = track < 0 ? -1 : part_track[track];
    if (k < 0) continue;
    report.points[input] = x.points.col(k);
    const auto rays = problem.RaysOf(k);
    const auto num_in_front = std::count_if(rays.begin(), rays.end(), [&](const auto& ray) {
      return ray.direction.dot(x.points.col(k) - x.cameras.col(ray.camera)) > 0;
    });
    report.point_is_valid[input] = num_in_front >= 2;
  }
  std::vector<int> part_camera(whole.NumCameras(), -1);
  for (size_t i = 0; i < part.camera_of.size(); ++i) {
    part_camera[part.camera_of[i]] = static_cast<int>(i);
  }
  for (size_t input = 0; input < whole.edge_of_input.size(); ++input) {
    const DirectionProblem::Edge& edge = whole.edges[whole.edge_of_input[input]];
    const int camera1 = part_camera[edge.camera1];
    const int camera2 = part_camera[edge.camera2];
    if (camera1 < 0 || camera2 < 0) continue;
    const Eigen::Vector3d D = x.cameras.col(camera2) - x.cameras.col(camera1);
    report.edge_errors_deg[input] = RadToDeg(AngleBetween(D, edge.direction));
  }
}

// Fills the status; false if the solution must not be used.
bool Accept(const DirectionProblem& problem, const Positions& x, const SpreadReport& spread,
            const TranslationAveragingOptions& options, TranslationAveragingReport& report) {
  const Errors errors = MeasureErrors(problem, x);
  report.median_edge_error_deg = UpperMedian(errors.edges_deg);
  report.median_ray_error_deg = UpperMedian(errors.rays_deg);
  if (spread.half_over_most < options.min_spread) {
    report.status = TranslationAveragingStatus::kCollapsed;
    report.message = "half of the cameras lie within " + std::to_string(spread.half_over_most) +
                     " of the extent of the others";
  } else if (std::max(report.median_edge_error_deg, report.median_ray_error_deg) >
             options.max_median_error_deg) {
    report.status = TranslationAveragingStatus::kInconsistent;
    report.message = "the median angle to the measured directions is " +
                     std::to_string(report.median_edge_error_deg) + " deg between cameras and " +
                     std::to_string(report.median_ray_error_deg) + " deg to points";
  } else {
    report.status = TranslationAveragingStatus::kSuccess;
  }
  return report.status == TranslationAveragingStatus::kSuccess;
}

std::vector<char> FilterEdges(const DirectionProblem& problem,
                              const TranslationAveragingOptions& options, const RunContext& run,
                              TranslationAveragingReport& report) {
  std::vector<char> is_out(problem.edges.size(), 0);
  if (options.filter_directions) {
    const std::vector<double> inconsistency =
        OneDsfmInconsistency(problem, options.filter_num_axes, run.seed, run.num_threads);
    for (size_t e = 0; e < is_out.size(); ++e) {
      is_out[e] = inconsistency[e] > options.filter_max_inconsistency;
    }
  }
  for (const int e : problem.edge_of_input) {
    report.edge_is_filtered.push_back(is_out[e]);
    report.num_filtered += is_out[e];
  }
  return is_out;
}

}  // namespace

std::string_view TranslationAveragingStatusName(TranslationAveragingStatus status) {
  switch (status) {
    case TranslationAveragingStatus::kSuccess:
      return "success";
    case TranslationAveragingStatus::kNoEdges:
      return "no_edges";
    case TranslationAveragingStatus::kCollapsed:
      return "collapsed";
    case TranslationAveragingStatus::kInconsistent:
      return "inconsistent";
    case TranslationAveragingStatus::kInterrupted:
      return "interrupted";
  }
  return "unknown";
}

TranslationAveragingReport AverageTranslations(std::span<const DirectionEdge> edges,
                                               std::span<const PointDirections> tracks,
                                               const TranslationAveragingOptions& options,
                                               const RunContext& run) {
  ValidateOptions(options, "translation_averaging");
  TranslationAveragingReport report;
  report.points.assign(tracks.size(), Eigen::Vector3d::Zero());
  report.point_is_valid.assign(tracks.size(), 0);
  report.edge_errors_deg.assign(edges.size(), -1.0);
  if (!options.use_points) tracks = {};
  const DirectionProblem whole = MakeDirectionProblem(edges, tracks);
  const std::vector<char> edge_is_out = FilterEdges(whole, options, run, report);

  const std::vector<int> placeable = LargestPlaceableSet(whole, edge_is_out);
  for (int i = 0; i < whole.NumCameras(); ++i) {
    if (!std::binary_search(placeable.begin(), placeable.end(), i)) {
      report.not_rigid.push_back(whole.image_ids[i]);
    }
  }
  if (placeable.empty()) return report;

  const DirectionSubproblem part = Restrict(whole, placeable, edge_is_out);
  Positions x = LeastUnsquaredDeviations(part.problem);
  PositionSystem system(part.problem, run.num_threads);
  FitWeights weights = BalancedWeights(part.problem, options);
  for (int pass = 0; pass <= options.num_reweightings && !run.monitor.StopRequested(); ++pass) {
    if (pass > 0)
      weights = WeightsFromErrors(part.problem, MeasureErrors(part.problem, x), options);
    weights.tolerance = pass < options.num_reweightings ? kCoarseTolerance : kFineTolerance;
    report.num_iterations +=
        FitPositions(part.problem, options, weights, system, x, run).num_iterations;
  }
  if (run.monitor.StopRequested()) {
    report.status = TranslationAveragingStatus::kInterrupted;
    return report;
  }
  Normalize(x);
  const SpreadReport spread = AnalyzeSpread(x.cameras, options.min_spread);
  if (!Accept(part.problem, x, spread, options, report)) return report;
  FillReport(whole, part, x, options, report);
  for (const int camera : spread.thrown_away) {
    const image_t image_id = part.problem.image_ids[camera];
    report.thrown_away.push_back(image_id);
    report.centers.erase(image_id);
    report.support.erase(image_id);
  }
  return report;
}

}  // namespace cairn
