#include "two_view/essential_estimator.h"

#include <cmath>

#include "cairn/geometry/epipolar.h"
#include "cairn/solvers/essential.h"

namespace cairn::internal {

int FivePointEstimator::Solve(const uint32_t* sample, Model* models) const {
  PointCorrespondence samples[kSampleSize];
  for (int i = 0; i < kSampleSize; ++i) {
    samples[i] = {pair_.points.Point1(sample[i]), pair_.points.Point2(sample[i])};
  }
  return FivePoint::Solve(samples, models);
}

double FivePointEstimator::Optimize(Model& E, int* num_inliers) const {
  const EssentialDecomposition parts = DecomposeEssential(E);
  Rigid3d pose(parts.R1, parts.t);  // Any of the four has this E.
  const double score = RefineAndScore(pair_, &pose);
  E = EssentialFromPose(pose);
  // Inliers uniform in error have a mean support of 2/3.
  *num_inliers = static_cast<int>(std::lround(score));
  return score;
}

double RefineAndScore(const PreparedPair& pair, Rigid3d* pose) {
  double best = ScoreSampson(pair.points, EssentialFromPose(*pose), pair.max_error_px);
  for (const double scale : {2.0, 1.0}) {
    PoseRefinementOptions options;
    options.loss = RobustLoss::kTruncated;
    options.scale_px = scale * pair.max_error_px;
    const Rigid3d refined = RefinePose(pair.points, *pose, options).cam2_from_cam1;
    const double score = ScoreSampson(pair.points, EssentialFromPose(refined), pair.max_error_px);
    if (!(score >= best)) continue;
    best = score;
    *pose = refined;
  }
  return best;
}

}  // namespace cairn::internal
