#include "relative_pose_experiments/paper_estimator.h"

#include <cmath>

#include "cairn/geometry/epipolar.h"
#include "cairn/solvers/five_point.h"
#include "cairn/solvers/one_affine_depth.h"
#include "robust/pose_refinement.h"
#include "robust/ransac.h"
#include "robust/sampson_kernels.h"

namespace cairn::experiments {
namespace {

// Everything of the estimator but its minimal solver.
class SampsonEstimator {
 public:
  using Model = Eigen::Matrix3d;

  SampsonEstimator(const NormalizedMatches& matches, double max_error_px)
      : matches_(matches), max_error_px_(max_error_px) {}

  int NumData() const { return matches_.size(); }
  double Score(const Model& E, double bound) const {
    return ScoreSampson(matches_.points(), E, max_error_px_, bound);
  }
  // Hypotheses of depth are rough: first a wide, smooth loss, then the threshold.
  double Optimize(Model& E, int* num_inliers) const {
    double best = Score(E, -1.0);
    Rigid3d pose = PosesFromEssential(E)[0];  // any of the four has this E
    for (const double scale : {8.0, 3.0, 1.0}) {
      PoseRefinementOptions options;
      options.loss = scale > 1.0 ? RobustLoss::kGemanMcClure : RobustLoss::kTruncated;
      options.scale_px = scale * max_error_px_;
      pose = RefinePose(matches_.points(), pose, options).cam2_from_cam1;
      const Model refined = EssentialFromPose(pose);
      const double score = Score(refined, -1.0);
      if (score > best) {
        best = score;
        E = refined;
      }
    }
    *num_inliers = static_cast<int>(Inliers(E).size());
    return best;
  }

  std::vector<int> Inliers(const Model& E) const {
    std::vector<float> errors(matches_.points().num_blocks() * PointPairs::kBlock);
    SampsonErrors(matches_.points(), E, errors.data());
    std::vector<int> inliers;
    for (int i = 0; i < matches_.size(); ++i) {
      if (errors[i] < max_error_px_) inliers.push_back(i);
    }
    return inliers;
  }

 protected:
  const NormalizedMatches& matches_;
  const double max_error_px_;
};

class FivePointEstimator : public SampsonEstimator {
 public:
  static constexpr int kSampleSize = FivePoint::kSampleSize;
  static constexpr int kMaxSolutions = FivePoint::kMaxSolutions;
  using SampsonEstimator::SampsonEstimator;
  int Solve(const uint32_t* sample, Model* models) const {
    PointCorrespondence points[kSampleSize];
    for (int i = 0; i < kSampleSize; ++i) {
      const int k = static_cast<int>(sample[i]);
      points[i] = {matches_.points().Point1(k), matches_.points().Point2(k)};
    }
    return FivePoint::Solve(points, models);
  }
};

class OneAffineDepthEstimator : public SampsonEstimator {
 public:
  static constexpr int kSampleSize = 1;
  static constexpr int kMaxSolutions = 1;
  using SampsonEstimator::SampsonEstimator;
  int Solve(const uint32_t* sample, Model* models) const {
    const auto pose = matches_.PoseFromOne(static_cast<int>(sample[0]));
    if (!pose) return 0;
    models[0] = EssentialFromPose(*pose);
    return 1;
  }
};

template <class Estimator>
PaperEstimate Run(const PairInput& input, const NormalizedMatches& matches,
                  const PaperEstimatorOptions& options) {
  Estimator estimator(matches, PaperThresholdPx(input, options));
  Rng rng(input.seed, "paper_estimator", input.pair_id);
  const auto report = Ransac(estimator,
                             {.confidence = options.confidence,
                              .min_iterations = options.min_iterations,
                              .max_iterations = options.max_iterations,
                              .initial_score = 0.0},
                             rng);
  PaperEstimate estimate;
  estimate.num_iterations = report.num_iterations;
  if (report.status != RansacStatus::kConfident && report.status != RansacStatus::kExhausted) {
    return estimate;
  }
  std::vector<Eigen::Vector3d> rays1, rays2;
  for (const int i : estimator.Inliers(report.model)) {
    rays1.push_back(matches.points().Ray1(i));
    rays2.push_back(matches.points().Ray2(i));
  }
  const CheiralityResult best = SelectPoseByCheirality(report.model, rays1, rays2);
  estimate.cam2_from_cam1 = best.cam2_from_cam1;
  estimate.num_inliers = best.num_in_front;
  return estimate;
}

}  // namespace

NormalizedMatches::NormalizedMatches(const PairInput& input) : input_(input) {
  const int n = static_cast<int>(input.matches.size());
  points_.Reset(n, input.camera1->MeanFocal(), input.camera2->MeanFocal());
  for (int i = 0; i < n; ++i) {
    const FeatureMatch& match = input.matches[i];
    const auto x1 = input.camera1->CamFromImg(input.keypoints1[match.point1].Position());
    const auto x2 = input.camera2->CamFromImg(input.keypoints2[match.point2].Position());
    if (!x1 || !x2) continue;
    points_.Set(static_cast<int>(match_index_.size()), *x1, *x2);
    match_index_.push_back(i);
  }
  points_.Truncate(static_cast<int>(match_index_.size()));
}

std::optional<Rigid3d> NormalizedMatches::PoseFromOne(int i) const {
  if (input_.depth1.empty() || input_.depth2.empty()) return std::nullopt;
  const FeatureMatch& match = input_.matches[match_index_[i]];
  const auto lift = [](const Camera& camera, const Keypoint& keypoint, const DepthSample& depth) {
    return depth.is_valid ? LiftFrame(camera, keypoint.Position(), keypoint.Shape(), depth.depth,
                                      {depth.ddepth_dx, depth.ddepth_dy})
                          : std::nullopt;
  };
  const auto frame1 =
      lift(*input_.camera1, input_.keypoints1[match.point1], input_.depth1[match.point1]);
  const auto frame2 =
      lift(*input_.camera2, input_.keypoints2[match.point2], input_.depth2[match.point2]);
  if (!frame1 || !frame2) return std::nullopt;
  const LiftedCorrespondence sample{*frame1, *frame2};
  ScaledPose model;
  if (OneAffineDepthProposed::Solve(&sample, &model) == 0) return std::nullopt;
  if (!(model.cam2_from_cam1.translation.norm() > 0)) return std::nullopt;
  model.cam2_from_cam1.translation.normalize();
  return model.cam2_from_cam1;
}

double PaperThresholdPx(const PairInput& input, const PaperEstimatorOptions& options) {
  return options.max_error_over_diagonal * 0.5 *
         (input.camera1->DiagonalPx() + input.camera2->DiagonalPx());
}

PaperEstimate EstimateAsPaper(const PairInput& input, MinimalSolver solver,
                              const PaperEstimatorOptions& options) {
  const NormalizedMatches matches(input);
  return solver == MinimalSolver::kFivePoint
             ? Run<FivePointEstimator>(input, matches, options)
             : Run<OneAffineDepthEstimator>(input, matches, options);
}

}  // namespace cairn::experiments
