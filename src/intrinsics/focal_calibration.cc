#include "cairn/intrinsics/focal_calibration.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/named_value.h"
#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "intrinsics/focal_problem.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

using internal::FitFundamental;
using internal::FocalProblem;
using internal::FocalTerm;
using internal::FundamentalFit;

// The rays that nominal focal lengths and undistorted pixels give.
PointPairs NominalRays(const FocalPair& pair, const Camera& camera1, const Camera& camera2) {
  CAIRN_CHECK_EQ(pair.pixels1.size(), pair.pixels2.size());
  PointPairs points;
  points.Reset(static_cast<int>(pair.pixels1.size()), camera1.MeanFocal(), camera2.MeanFocal());
  for (int i = 0; i < points.size(); ++i) {
    points.Set(i, (pair.pixels1[i] - camera1.PrincipalPoint()) / camera1.MeanFocal(),
               (pair.pixels2[i] - camera2.PrincipalPoint()) / camera2.MeanFocal());
  }
  return points;
}

// The pair's F, of these rays.
Eigen::Matrix3d NominalF(const FocalPair& pair, const Camera& camera1, const Camera& camera2) {
  const auto pinhole = [](const Camera& camera) {
    Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
    K.diagonal().head<2>().setConstant(camera.MeanFocal());
    K.col(2).head<2>() = camera.PrincipalPoint();
    return K;
  };
  return pinhole(camera2).transpose() * pair.F * pinhole(camera1);
}

FocalStatus Judge(const Camera& camera, const CalibratedFocal& focal,
                  const FocalCalibrationOptions& options) {
  if (focal.num_pairs < options.min_pairs) return FocalStatus::kTooFewPairs;
  if (2 * focal.num_agreeing < focal.num_pairs) return FocalStatus::kContradicted;
  if (!(focal.sigma <= options.max_sigma)) return FocalStatus::kUndetermined;
  const double larger_side = std::max(camera.width, camera.height);
  const double fov_deg = RadToDeg(2 * std::atan(0.5 * larger_side / focal.focal_px));
  if (fov_deg < options.min_fov_deg || fov_deg > options.max_fov_deg) {
    return FocalStatus::kImplausible;
  }
  if (camera.has_prior_focal_length) {
    const double change = std::abs(std::log(focal.focal_px / focal.focal_before_px));
    // Three standard deviations: one camera in some hundreds would be changed by chance.
    if (change <= std::max(options.min_exif_error, 3 * focal.sigma)) return FocalStatus::kConfirmed;
  }
  return FocalStatus::kCalibrated;
}

// Throws ConfigError unless the pairs' cameras are there and have pixels for which there is an F.
void CheckPairs(const std::map<camera_t, Camera>& cameras, std::span<const FocalPair> pairs) {
  for (const FocalPair& pair : pairs) {
    for (const camera_t id : {pair.camera_id1, pair.camera_id2}) {
      const std::string name = "camera " + std::to_string(id);
      const auto camera = cameras.find(id);
      if (camera == cameras.end()) throw ConfigError("pairs", "there is no " + name);
      if (camera->second.IsPlanar()) continue;
      throw ConfigError("pairs", name + " is " +
                                     std::string(CameraModelName(camera->second.model)) +
                                     ", whose pixels have no fundamental matrix");
    }
  }
}

// As a share of the focal length.
double PrincipalPointSigma(const Camera& camera, const FocalCalibrationOptions& options) {
  return options.principal_point_sigma * std::max(camera.width, camera.height) / camera.MeanFocal();
}

}  // namespace

void FocalCalibrationOptions::VisitFields(OptionVisitor& v) {
  v.Bool("enabled", enabled,
         "in a reconstruction: find focal lengths that are only guessed, or wrong in EXIF, from "
         "the pairs");
  v.Int("min_pairs", min_pairs, {1, 1000000}, "pairs that must agree with a camera's focal length");
  v.Int("max_pairs", max_pairs, {1, 1000000},
        "in a reconstruction: pairs used for a camera, most inliers first");
  v.Double("max_sigma", max_sigma, {1e-6, 10},
           "largest relative standard deviation of a focal length that is taken over");
  v.Double("guess_sigma", guess_sigma, {1e-3, 100},
           "standard deviation of guessed focal lengths, as a logarithm");
  v.Double("exif_sigma", exif_sigma, {1e-3, 100},
           "standard deviation of focal lengths from EXIF, as a logarithm");
  v.Double("min_exif_error", min_exif_error, {0, 100},
           "EXIF is overruled only if it is off by more, as a logarithm");
  v.Double("principal_point_sigma", principal_point_sigma, {0, 1},
           "standard deviation of principal points, share of the larger side");
  v.Double("min_fov_deg", min_fov_deg, {0, 180},
           "smallest plausible field of view of the larger side, degrees");
  v.Double("max_fov_deg", max_fov_deg, {0, 180},
           "largest plausible field of view of the larger side, degrees");
}

std::string_view FocalStatusName(FocalStatus status) {
  using enum FocalStatus;
  constexpr NamedValue<FocalStatus> kNames[] = {
      {kCalibrated, "calibrated"},     {kConfirmed, "confirmed"},
      {kTooFewPairs, "too_few_pairs"}, {kContradicted, "contradicted"},
      {kUndetermined, "undetermined"}, {kImplausible, "implausible"}};
  return NameOf(kNames, status);
}

std::vector<size_t> SelectFocalPairs(std::span<const FocalPairCount> pairs, int max_pairs) {
  std::map<camera_t, int> counts;
  std::vector<size_t> selected;
  const auto key = [&](int i) { return -pairs[i].num_inliers; };
  for (const int i : SortedOrder(pairs.size(), key)) {
    int& count1 = counts[pairs[i].camera_id1];
    int& count2 = counts[pairs[i].camera_id2];
    if (count1 >= max_pairs && count2 >= max_pairs) continue;
    ++count1;
    if (&count1 != &count2) ++count2;
    selected.push_back(i);
  }
  std::sort(selected.begin(), selected.end());
  return selected;
}

FocalCalibrationReport CalibrateFocals(const std::map<camera_t, Camera>& cameras,
                                       const std::set<camera_t>& trusted,
                                       std::span<const FocalPair> pairs,
                                       const FocalCalibrationOptions& options,
                                       const RunContext& run) {
  ValidateOptions(options, "focal_calibration");
  CheckPairs(cameras, pairs);
  std::vector<std::optional<FundamentalFit>> fits(pairs.size());
  std::vector<PointPairs> points(pairs.size());
  ParallelFor(run.num_threads, static_cast<int64_t>(pairs.size()), [&](int64_t i) {
    const Camera& camera1 = cameras.at(pairs[i].camera_id1);
    const Camera& camera2 = cameras.at(pairs[i].camera_id2);
    points[i] = NominalRays(pairs[i], camera1, camera2);
    fits[i] = FitFundamental(points[i], NominalF(pairs[i], camera1, camera2));
  });

  FocalCalibrationReport report;
  std::map<camera_t, int> index;  // of the cameras that are sought; -1: trusted
  std::vector<camera_t> camera_ids;
  std::vector<double> prior_sigmas;
  const auto use = [&](camera_t id) {
    const auto [it, is_new] = index.try_emplace(id, -1);
    if (is_new && trusted.count(id) == 0) {
      it->second = static_cast<int>(camera_ids.size());
      camera_ids.push_back(id);
      prior_sigmas.push_back(cameras.at(id).has_prior_focal_length ? options.exif_sigma
                                                                   : options.guess_sigma);
    }
    return it->second;
  };
  std::vector<FocalTerm> terms;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (!fits[i]) {
      points[i] = PointPairs();
      continue;
    }
    FocalTerm term;
    term.camera1 = use(pairs[i].camera_id1);
    term.camera2 = use(pairs[i].camera_id2);
    term.principal_point_sigmas = {PrincipalPointSigma(cameras.at(pairs[i].camera_id1), options),
                                   PrincipalPointSigma(cameras.at(pairs[i].camera_id2), options)};
    term.fit = *fits[i];
    term.points = std::move(points[i]);
    if (term.camera1 >= 0 || term.camera2 >= 0) terms.push_back(std::move(term));
  }
  const FocalProblem problem(std::move(terms), std::move(prior_sigmas));
  const internal::FocalSolution solution = problem.Solve(run.num_threads);
  report.num_pairs = solution.num_terms;
  report.num_pairs_agreeing = solution.num_agreeing;
  for (size_t v = 0; v < camera_ids.size(); ++v) {
    const Camera& camera = cameras.at(camera_ids[v]);
    CalibratedFocal& focal = report.cameras[camera_ids[v]];
    focal.focal_before_px = camera.MeanFocal();
    focal.focal_px = camera.MeanFocal() * std::exp(solution.log_focals[v]);
    focal.sigma = solution.sigmas[v];
    focal.num_pairs = solution.num_terms_of[v];
    focal.num_agreeing = solution.num_agreeing_of[v];
    focal.status = Judge(camera, focal, options);
  }
  return report;
}

}  // namespace cairn
