#include "relative_pose_experiments/paper_estimator.h"

#include "cairn/geometry/epipolar.h"
#include "cairn/solvers/five_point.h"
#include "cairn/solvers/one_affine_depth.h"
#include "robust/match_errors.h"
#include "robust/pose_refinement.h"
#include "robust/ransac.h"
#include "robust/sampson_kernels.h"

namespace cairn::experiments {
namespace {

using internal::PreparedPair;

// Everything of the estimator but its minimal solver.
class SampsonEstimator {
 public:
  using Model = Eigen::Matrix3d;

  explicit SampsonEstimator(const PreparedPair& pair) : pair_(pair) {}

  int NumData() const { return pair_.size(); }
  double Score(const Model& E, double bound) const {
    return ScoreSampson(pair_.points, E, pair_.max_error_px, bound);
  }
  // Hypotheses of depth are rough: first a wide, smooth loss, then the threshold.
  double Optimize(Model& E, int* num_inliers) const {
    double best = Score(E, -1.0);
    Rigid3d pose = PosesFromEssential(E)[0];  // any of the four has this E
    for (const double scale : {8.0, 3.0, 1.0}) {
      PoseRefinementOptions options;
      options.loss = scale > 1.0 ? RobustLoss::kGemanMcClure : RobustLoss::kTruncated;
      options.scale_px = scale * pair_.max_error_px;
      pose = RefinePose(pair_.points, pose, options);
      const Model refined = EssentialFromPose(pose);
      const double score = Score(refined, -1.0);
      if (score > best) {
        best = score;
        E = refined;
      }
    }
    *num_inliers = MatchErrors(pair_.points, E).CountBelow(pair_.max_error_px);
    return best;
  }

 protected:
  const PreparedPair& pair_;
};

class FivePointEstimator : public SampsonEstimator {
 public:
  static constexpr int kSampleSize = FivePoint::kSampleSize;
  static constexpr int kMaxSolutions = FivePoint::kMaxSolutions;
  using SampsonEstimator::SampsonEstimator;
  int Solve(const uint32_t* sample, Model* models) const {
    PointCorrespondence points[kSampleSize];
    for (int i = 0; i < kSampleSize; ++i) points[i] = pair_.Points(static_cast<int>(sample[i]));
    return FivePoint::Solve(points, models);
  }
};

class OneAffineDepthEstimator : public SampsonEstimator {
 public:
  static constexpr int kSampleSize = 1;
  static constexpr int kMaxSolutions = 1;
  using SampsonEstimator::SampsonEstimator;
  int Solve(const uint32_t* sample, Model* models) const {
    const auto pose = PoseFromOne(pair_, static_cast<int>(sample[0]));
    if (!pose) return 0;
    models[0] = EssentialFromPose(*pose);
    return 1;
  }
};

template <class Estimator>
PairReport Run(const PreparedPair& pair) {
  Estimator estimator(pair);
  Rng rng(pair.input.seed, "paper_estimator", pair.input.pair_id);
  const auto found =
      Ransac(estimator, {.confidence = 0.99, .min_iterations = 20, .max_iterations = 10000}, rng);
  PairReport report;
  report.num_iterations = found.num_iterations;
  if (!found.model) return report;
  std::vector<Eigen::Vector3d> rays1, rays2;
  for (const int32_t i : MatchErrors(pair.points, *found.model).Below(pair.max_error_px)) {
    rays1.push_back(pair.points.Ray1(i));
    rays2.push_back(pair.points.Ray2(i));
  }
  const CheiralityResult best = SelectPoseByCheirality(*found.model, rays1, rays2);
  report.status = PairStatus::kVerified;
  report.geometry.cam2_from_cam1 = best.cam2_from_cam1;
  report.num_inliers = best.num_in_front;
  return report;
}

std::optional<LiftedFrame> Lift(const Camera& camera, const Keypoint& keypoint,
                                const DepthSample& depth) {
  if (!depth.is_valid) return std::nullopt;
  return LiftFrame(camera, keypoint.Position(), keypoint.Shape(), depth.depth,
                   {depth.ddepth_dx, depth.ddepth_dy});
}

}  // namespace

PreparedPair PrepareAsPaper(PairInput input) {
  input.are_best_first = true;  // PreparePair keeps their order then
  const double diagonal_px = 0.5 * (input.camera1->DiagonalPx() + input.camera2->DiagonalPx());
  PreparedPair pair;
  PreparePair(input, {.max_error_px = 0.0005 * diagonal_px}, internal::MatchOrder::kGiven, &pair);
  return pair;
}

std::optional<Rigid3d> PoseFromOne(const PreparedPair& pair, int i) {
  if (!pair.HasDepth()) return std::nullopt;
  const auto frame1 = Lift(*pair.input.camera1, pair.Keypoint1(i), pair.Depth1(i));
  const auto frame2 = Lift(*pair.input.camera2, pair.Keypoint2(i), pair.Depth2(i));
  if (!frame1 || !frame2) return std::nullopt;
  const LiftedCorrespondence sample{*frame1, *frame2};
  ScaledPose model;
  if (OneAffineDepthProposed::Solve(&sample, &model) == 0) return std::nullopt;
  if (!(model.cam2_from_cam1.translation.norm() > 0)) return std::nullopt;
  model.cam2_from_cam1.translation.normalize();
  return model.cam2_from_cam1;
}

PairReport EstimateAsPaper(const PairInput& input, MinimalSolver solver) {
  const PreparedPair pair = PrepareAsPaper(input);
  return solver == MinimalSolver::kFivePoint ? Run<FivePointEstimator>(pair)
                                             : Run<OneAffineDepthEstimator>(pair);
}

}  // namespace cairn::experiments
