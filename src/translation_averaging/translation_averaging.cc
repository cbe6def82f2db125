#include "cairn/translation_averaging/translation_averaging.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/base/named_value.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "translation_averaging/direction_problem.h"
#include "translation_averaging/nonlinear_fit.h"
#include "translation_averaging/one_dsfm_filter.h"
#include "translation_averaging/position_system.h"
#include "translation_averaging/rigidity.h"
#include "translation_averaging/start.h"

namespace cairn {
namespace {

// The noise is at least this: measured errors of few or perfect directions mean little.
constexpr double kMinEdgeNoiseDeg = 0.1;
constexpr double kMinRayNoiseDeg = 0.02;
// Relative decrease of the cost at which a fit ends, before the weights change and after.
constexpr double kCoarseTolerance = 1e-3;
constexpr double kFineTolerance = 1e-5;
// Errors count linearly from so many times the noise on, once it is known, and are gross ones from
// so many on.
constexpr double kHuberNoises = 2;
constexpr double kMostNoises = 6;

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

// Cameras so far out that they can only have been thrown there: their nearest neighbor is a
// thousand times as far as neighbors are (the median over the edges). Many cameras in one place,
// by a tripod, are no reason to leave others out: pairs of theirs have no direction.
std::vector<int> ThrownAway(const DirectionProblem& problem, const Eigen::Matrix3Xd& centers) {
  constexpr double kMaxRatio = 1e3;
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::vector<double> lengths;
  std::vector<double> nearest(problem.NumCameras(), kNone);
  for (const DirectionProblem::Edge& edge : problem.edges) {
    const double length = (centers.col(edge.camera2) - centers.col(edge.camera1)).norm();
    lengths.push_back(length);
    for (const int camera : {edge.camera1, edge.camera2}) {
      nearest[camera] = std::min(nearest[camera], length);
    }
  }
  std::vector<int> thrown_away;
  if (lengths.empty()) return thrown_away;
  const double most = kMaxRatio * UpperMedian(lengths);
  for (int camera = 0; camera < problem.NumCameras(); ++camera) {
    if (nearest[camera] > most && nearest[camera] < kNone) thrown_away.push_back(camera);
  }
  return thrown_away;
}

// Edges count one each, all rays together as point_weight times that.
FitWeights BalancedWeights(const DirectionProblem& problem,
                           const TranslationAveragingOptions& options) {
  FitWeights weights;
  weights.edge_huber_deg = weights.ray_huber_deg = options.huber_deg;
  weights.max_iterations = options.max_iterations;
  weights.edges.assign(problem.edges.size(), 1.0);
  const double num_edges = static_cast<double>(problem.edges.size());
  const double num_rays = static_cast<double>(problem.rays.size());
  weights.rays.assign(problem.rays.size(),
                      num_edges > 0 ? options.point_weight * num_edges / num_rays : 1.0);
  return weights;
}

// Tukey's weight of an error; `noise` is the median of errors.
double TukeyWeight(double error, double noise) {
  const double u = error / (kMostNoises * noise);
  return u >= 1 ? 0.0 : (1 - u * u) * (1 - u * u);
}

// Edges and rays by what the last fit showed of their precision: inverse variances, gross errors
// out.
FitWeights WeightsFromErrors(const DirectionProblem& problem, const Errors& errors,
                             const TranslationAveragingOptions& options) {
  const double edge_noise = std::max(UpperMedian(errors.edges_deg), kMinEdgeNoiseDeg);
  const double ray_noise = std::max(UpperMedian(errors.rays_deg), kMinRayNoiseDeg);
  FitWeights weights = BalancedWeights(problem, options);
  weights.edge_huber_deg = kHuberNoises * edge_noise;
  weights.ray_huber_deg = kHuberNoises * ray_noise;
  for (size_t e = 0; e < weights.edges.size(); ++e) {
    weights.edges[e] *= TukeyWeight(errors.edges_deg[e], edge_noise);
  }
  const double ratio = edge_noise / ray_noise;
  for (size_t r = 0; r < weights.rays.size(); ++r) {
    weights.rays[r] = ratio * ratio * TukeyWeight(errors.rays_deg[r], ray_noise);
  }
  return weights;
}

std::map<image_t, Eigen::Vector3d> CentersOf(const DirectionProblem& problem, const Positions& x) {
  std::map<image_t, Eigen::Vector3d> centers;
  for (int i = 0; i < problem.NumCameras(); ++i) centers[problem.image_ids[i]] = x.cameras.col(i);
  return centers;
}

// The unit of their cost is the variance of an edge, as it is of all others.
std::vector<CenterTerm> TermsOf(const std::vector<CenterPrior>& priors,
                                const DirectionProblem& problem, double edge_noise_deg) {
  const double noise = DegToRad(edge_noise_deg);
  std::vector<CenterTerm> terms;
  for (const CenterPrior& prior : priors) {
    const auto id =
        std::lower_bound(problem.image_ids.begin(), problem.image_ids.end(), prior.image_id);
    if (id == problem.image_ids.end() || *id != prior.image_id) continue;
    terms.push_back({static_cast<int>(id - problem.image_ids.begin()), prior.center,
                     noise * noise * prior.information});
  }
  return terms;
}

// The sum of squared errors in units of the noise, none above six (Tukey's limit).
double RobustCost(const Errors& errors, double edge_noise, double ray_noise) {
  const auto sum = [](const std::vector<double>& values, double noise) {
    double cost = 0;
    for (const double value : values) cost += std::pow(std::min(value / noise, kMostNoises), 2);
    return cost;
  };
  return sum(errors.edges_deg, edge_noise) + sum(errors.rays_deg, ray_noise);
}

bool IsBetter(const Errors& a, const Errors& b) {
  const auto noise = [&](std::vector<double> Errors::*of, double least) {
    return std::max(std::min(UpperMedian(a.*of), UpperMedian(b.*of)), least);
  };
  const double edge_noise = noise(&Errors::edges_deg, kMinEdgeNoiseDeg);
  const double ray_noise = noise(&Errors::rays_deg, kMinRayNoiseDeg);
  return RobustCost(a, edge_noise, ray_noise) < RobustCost(b, edge_noise, ray_noise);
}

// Fits positions, again and again by weights from the errors; errors of a start that is near mean
// something already.
class PositionFit {
 public:
  PositionFit(const DirectionProblem& problem, const TranslationAveragingOptions& options,
              const RunContext& run, TranslationAveragingReport& report)
      : problem_(problem),
        options_(options),
        run_(run),
        report_(report),
        system_(problem, run.num_threads) {}

  void Fit(const FitWeights& weights, Positions& x) {
    report_.num_iterations += FitPositions(problem_, weights, system_, x, run_).num_iterations;
  }
  void FitFrom(bool is_near, Positions& x) {
    for (int pass = 0; pass <= options_.num_reweightings && !run_.monitor.StopRequested(); ++pass) {
      FitWeights weights = pass > 0 || is_near
                               ? WeightsFromErrors(problem_, MeasureErrors(problem_, x), options_)
                               : BalancedWeights(problem_, options_);
      weights.tolerance = pass < options_.num_reweightings ? kCoarseTolerance : kFineTolerance;
      Fit(weights, x);
    }
  }

 private:
  const DirectionProblem& problem_;
  const TranslationAveragingOptions& options_;
  const RunContext& run_;
  TranslationAveragingReport& report_;
  PositionSystem system_;
};

// By the directions, from the better of two starts, and then with priors of the centers, too.
Positions PlaceCameras(const DirectionProblem& problem, const TranslationAveragingOptions& options,
                       const CenterPriors& priors, const RunContext& run,
                       TranslationAveragingReport& report) {
  PositionFit fit(problem, options, run, report);
  Positions x = LeastUnsquaredDeviations(problem, run.num_threads);
  fit.FitFrom(false, x);
  if (auto by_lengths = StartByLengths(problem, run.num_threads)) {
    fit.FitFrom(true, *by_lengths);
    report.is_by_lengths = IsBetter(MeasureErrors(problem, *by_lengths), MeasureErrors(problem, x));
    if (report.is_by_lengths) x = std::move(*by_lengths);
  }
  Normalize(x);
  if (!priors || run.monitor.StopRequested()) return x;
  FitWeights weights = WeightsFromErrors(problem, MeasureErrors(problem, x), options);
  weights.tolerance = kFineTolerance;
  weights.centers =
      TermsOf(priors(CentersOf(problem, x)), problem, weights.edge_huber_deg / kHuberNoises);
  report.num_priors = static_cast<int>(weights.centers.size());
  if (report.num_priors == 0) return x;
  fit.Fit(weights, x);
  Normalize(x);
  return x;
}

// Fills the status; false if the solution must not be used.
bool Accept(const DirectionProblem& problem, const Positions& x,
            const TranslationAveragingOptions& options, TranslationAveragingReport& report) {
  const Errors errors = MeasureErrors(problem, x);
  report.median_edge_error_deg = UpperMedian(errors.edges_deg);
  report.median_ray_error_deg = UpperMedian(errors.rays_deg);
  if (std::max(report.median_edge_error_deg, report.median_ray_error_deg) >
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
  const std::vector<double> inconsistency =
      OneDsfmInconsistency(problem, options.filter_num_axes, run.seed, run.num_threads);
  for (size_t e = 0; e < is_out.size(); ++e) {
    is_out[e] = inconsistency[e] > options.filter_max_inconsistency;
  }
  for (const int e : problem.edge_of_input) {
    report.edge_is_filtered.push_back(is_out[e]);
    report.num_filtered += is_out[e];
  }
  return is_out;
}

}  // namespace

std::string_view TranslationAveragingStatusName(TranslationAveragingStatus status) {
  using enum TranslationAveragingStatus;
  constexpr NamedValue<TranslationAveragingStatus> kNames[] = {{kSuccess, "success"},
                                                               {kNoEdges, "no_edges"},
                                                               {kInconsistent, "inconsistent"},
                                                               {kInterrupted, "interrupted"}};
  return NameOf(kNames, status);
}

TranslationAveragingReport AverageTranslations(std::span<const DirectionEdge> edges,
                                               std::span<const PointDirections> tracks,
                                               const TranslationAveragingOptions& options,
                                               const RunContext& run, const CenterPriors& priors) {
  ValidateOptions(options, "translation_averaging");
  TranslationAveragingReport report;
  const DirectionProblem whole = MakeDirectionProblem(edges, tracks);
  const std::vector<char> edge_is_out = FilterEdges(whole, options, run, report);

  const std::vector<int> placeable = LargestPlaceableSet(whole, edge_is_out);
  for (int i = 0; i < whole.NumCameras(); ++i) {
    if (!std::binary_search(placeable.begin(), placeable.end(), i)) {
      report.not_rigid.push_back(whole.image_ids[i]);
    }
  }
  if (placeable.empty()) {
    report.message = "the directions fix no two cameras";
    return report;
  }

  const DirectionProblem part = Restrict(whole, placeable, edge_is_out);
  const Positions x = PlaceCameras(part, options, priors, run, report);
  if (run.monitor.StopRequested()) {
    report.status = TranslationAveragingStatus::kInterrupted;
    return report;
  }
  if (!Accept(part, x, options, report)) return report;
  report.centers = CentersOf(part, x);
  for (const int camera : ThrownAway(part, x.cameras)) report.centers.erase(part.image_ids[camera]);
  return report;
}

}  // namespace cairn
