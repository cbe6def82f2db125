#include "cairn/resection/resection.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/base/check.h"
#include "resection/p3p.h"
#include "resection/pose_refinement.h"
#include "robust/ransac.h"

namespace cairn {
namespace {

// Pixels with a world point, and their rays under one camera.
class ResectionEstimator {
 public:
  static constexpr int kSampleSize = P3pSolver::kSampleSize;
  static constexpr int kMaxSolutions = P3pSolver::kMaxSolutions;
  using Model = Rigid3d;

  ResectionEstimator(const Camera& camera, const PixelsOfPoints& points, double max_error_px)
      : camera_(camera), points_(points), max_error_px_(max_error_px) {
    const std::span<const Eigen::Vector2d> pixels = points.pixels;
    for (size_t i = 0; i < pixels.size(); ++i) {
      if (!camera.IsPlanar()) {
        const std::optional<Eigen::Vector3d> bearing = camera.RayFromImg(pixels[i]);
        if (!bearing) continue;
        usable_.push_back(static_cast<int>(i));
        bearings_.push_back(*bearing);
        continue;
      }
      const std::optional<Eigen::Vector2d> ray = camera.CamFromImg(pixels[i]);
      if (!ray) continue;
      usable_.push_back(static_cast<int>(i));
      rays_.push_back(*ray);
      bearings_.push_back(ray->homogeneous().normalized());
    }
  }

  int NumData() const { return static_cast<int>(usable_.size()); }

  int Solve(const uint32_t* sample, Model* models) const {
    P3pSample samples[kSampleSize];
    for (int k = 0; k < kSampleSize; ++k) {
      samples[k] = {bearings_[sample[k]], points_.xyz[usable_[sample[k]]]};
    }
    return P3pSolver::Solve(samples, models);
  }

  // MSAC (Torr and Zisserman 2000): the sum of 1 - (error / max_error)^2 over the inliers.
  double Score(const Model& model, double bound) const {
    const Eigen::Matrix3d R = model.RotationMatrix();
    const double factor = std::pow(camera_.MeanFocal() / max_error_px_, 2);
    double score = 0;
    for (size_t i = 0; i < usable_.size(); ++i) {
      // What is left cannot reach the bound.
      if (score + static_cast<double>(usable_.size() - i) <= bound) return bound;
      const Eigen::Vector3d x = R * points_.xyz[usable_[i]] + model.translation;
      const double squared = factor * SquaredError(i, x);
      if (squared < 1.0) score += 1.0 - squared;
    }
    return score;
  }

  double Optimize(Model& model, int* num_inliers) const {
    double score = Score(model, -1.0);
    for (int round = 0; round < 3; ++round) {
      const std::vector<int> inliers = Inliers(model);
      if (inliers.size() < kSampleSize) break;
      Camera camera = camera_;
      Model candidate = model;
      RefinePose(points_, inliers, {.loss_scale_px = 0.5 * max_error_px_, .max_iterations = 10},
                 camera, candidate);
      const double candidate_score = Score(candidate, -1.0);
      if (!(candidate_score > score)) break;
      score = candidate_score;
      model = candidate;
    }
    *num_inliers = static_cast<int>(Inliers(model).size());
    return score;
  }

  // Indices of the correspondences with an error (undistorted pixels; pixels where the camera is
  // not planar) up to the threshold.
  std::vector<int> Inliers(const Model& model) const {
    std::vector<int> inliers;
    const Eigen::Matrix3d R = model.RotationMatrix();
    for (size_t i = 0; i < usable_.size(); ++i) {
      const Eigen::Vector3d x = R * points_.xyz[usable_[i]] + model.translation;
      const double error_px = camera_.MeanFocal() * std::sqrt(SquaredError(i, x));
      if (error_px <= max_error_px_) inliers.push_back(usable_[i]);
    }
    return inliers;
  }

 private:
  // Of the i-th usable correspondence with its point in the camera's frame, in units of the focal
  // length; infinite where the camera does not see it.
  double SquaredError(size_t i, const Eigen::Vector3d& x) const {
    if (camera_.IsPlanar()) {
      if (!(x.z() > 0)) return std::numeric_limits<double>::infinity();
      return (x.hnormalized() - rays_[i]).squaredNorm();
    }
    const auto pixel = camera_.ImgFromRay(x);
    if (!pixel) return std::numeric_limits<double>::infinity();
    const CameraParams params = {camera_.model, camera_.params.data()};
    return PixelDifference(params, *pixel, points_.pixels[usable_[i]]).squaredNorm() /
           std::pow(camera_.MeanFocal(), 2);
  }

  Camera camera_;
  PixelsOfPoints points_;
  double max_error_px_;
  std::vector<int> usable_;            // correspondences whose distortion can be undone
  std::vector<Eigen::Vector2d> rays_;  // of planar cameras alone
  std::vector<Eigen::Vector3d> bearings_;
};

// The guess itself, then others between a half and twice of it, evenly in the logarithm.
std::vector<double> FocalFactors(bool estimate_focal, int num_guesses) {
  std::vector<double> factors = {1.0};
  if (!estimate_focal) return factors;
  for (int i = 0; i < num_guesses; ++i) {
    if (2 * i + 1 == num_guesses) continue;  // the guess itself
    factors.push_back(std::pow(2.0, 2.0 * (i + 0.5) / num_guesses - 1.0));
  }
  return factors;
}

// The pose, and focal length, with the most support.
ResectionReport SearchPose(const Camera& camera, const PixelsOfPoints& points,
                           const std::vector<double>& focal_factors,
                           const ResectionOptions& options, const Rng& rng) {
  ResectionReport report;
  RansacOptions ransac_options;
  ransac_options.confidence = options.confidence;
  ransac_options.max_iterations = options.max_iterations;
  ransac_options.min_iterations =
      std::min(ransac_options.min_iterations, ransac_options.max_iterations);
  for (const double factor : focal_factors) {
    Camera candidate = camera;
    candidate.SetMeanFocal(factor * camera.MeanFocal());
    ResectionEstimator estimator(candidate, points, options.max_error_px);
    Rng own_rng = rng;
    const auto ransac = Ransac(estimator, ransac_options, own_rng);
    report.num_iterations += static_cast<int>(ransac.num_iterations);
    if (!ransac.model) continue;
    report.status = ResectionStatus::kSuccess;
    ransac_options.initial_score = ransac.score;
    // Another length has to beat this one, so it has at least about as many inliers.
    ransac_options.max_iterations =
        std::min(ransac_options.max_iterations,
                 NumRansacIterations(ransac.score / static_cast<double>(points.pixels.size()),
                                     P3pSolver::kSampleSize, options.confidence));
    ransac_options.min_iterations =
        std::min(ransac_options.min_iterations, ransac_options.max_iterations);
    report.camera = candidate;
    report.cam_from_world = *ransac.model;
  }
  return report;
}

// With the focal length where it is open; the inliers may become more.
void RefineOnInliers(const PixelsOfPoints& points, bool estimate_focal,
                     const ResectionOptions& options, ResectionReport& report) {
  for (int round = 0; round < 3; ++round) {
    const ResectionEstimator estimator(report.camera, points, options.max_error_px);
    std::vector<int> inliers = estimator.Inliers(report.cam_from_world);
    const bool same = round > 0 && inliers == report.inliers;
    report.inliers = std::move(inliers);
    if (same || report.inliers.size() < 4) break;
    RefinePose(points, report.inliers,
               {.refine_focal = estimate_focal, .loss_scale_px = 0.25 * options.max_error_px},
               report.camera, report.cam_from_world);
  }
  const ResectionEstimator estimator(report.camera, points, options.max_error_px);
  report.inliers = estimator.Inliers(report.cam_from_world);
}

}  // namespace

void ResectionOptions::VisitFields(OptionVisitor& v) {
  v.Double("max_error_px", max_error_px, {1e-6, 1e6},
           "largest error of an inlier, pixels; in proportion for photographs larger than 3200 px");
  v.Int("min_num_inliers", min_num_inliers, {4, 1000000}, "inliers that a pose needs");
  v.Double("min_inlier_ratio", min_inlier_ratio, {0, 1},
           "share of the correspondences that must be inliers");
  v.Int("max_iterations", max_iterations, {1, 100000000}, "largest number of samples");
  v.Double("confidence", confidence, {0, 0.9999999999},
           "probability of having drawn a sample without outliers");
  v.Int("num_focal_guesses", num_focal_guesses, {0, 1000},
        "other focal lengths tried where it is only a guess");
}

ResectionReport EstimateAbsolutePose(const Camera& camera, const PixelsOfPoints& points,
                                     bool estimate_focal, const ResectionOptions& options,
                                     const Rng& rng) {
  const auto& [pixels, xyz] = points;
  CAIRN_CHECK_EQ(pixels.size(), xyz.size());
  ValidateOptions(options, "resection");
  ResectionReport report;
  if (static_cast<int>(pixels.size()) < options.min_num_inliers) {
    report.status = ResectionStatus::kTooFewPoints;
    return report;
  }
  ResectionOptions scaled = options;
  scaled.max_error_px *= camera.ErrorScale();
  const std::vector<double> factors = FocalFactors(estimate_focal, options.num_focal_guesses);
  report = SearchPose(camera, points, factors, scaled, rng);
  if (report.status != ResectionStatus::kSuccess) return report;
  RefineOnInliers(points, estimate_focal, scaled, report);
  const auto num_inliers = static_cast<double>(report.inliers.size());
  if (num_inliers < options.min_num_inliers ||
      num_inliers < options.min_inlier_ratio * static_cast<double>(pixels.size())) {
    report.status = ResectionStatus::kTooFewInliers;
  }
  return report;
}

}  // namespace cairn
