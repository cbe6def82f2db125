#include "relative_pose_experiments/solver_runs.h"

#include <cmath>
#include <limits>
#include <vector>

#include "cairn/geometry/epipolar.h"

namespace cairn::experiments {
namespace {

constexpr int kNumAll = kNumSampled + kNumOthers;

Rigid3d PoseInFront(const Eigen::Matrix3d& E, const Instance& instance) {
  std::vector<Eigen::Vector3d> x1, x2;
  for (int i = 0; i < kNumAll; ++i) {
    const PointCorrespondence points = PointsOf(instance, i);
    x1.emplace_back(points.x1.homogeneous());
    x2.emplace_back(points.x2.homogeneous());
  }
  return SelectPoseByCheirality(E, x1, x2).cam2_from_cam1;
}

std::optional<Rigid3d> SelectPose(const Eigen::Matrix3d* models, int count, bool are_essential,
                                  const Instance& instance) {
  std::optional<Eigen::Matrix3d> best;
  double least_error = std::numeric_limits<double>::infinity();
  for (int i = 0; i < count; ++i) {
    const Eigen::Matrix3d E = are_essential ? models[i] : NearestEssential(models[i]);
    const double error = MeanSampsonPx(E, instance, kNumSampled);
    if (error < least_error) {
      least_error = error;
      best = E;
    }
  }
  if (!best) return std::nullopt;
  return PoseInFront(*best, instance);
}

}  // namespace

double MeanSampsonPx(const Eigen::Matrix3d& E, const Instance& instance, int begin) {
  double sum = 0;
  for (int i = begin; i < kNumAll; ++i) {
    const PointCorrespondence points = PointsOf(instance, i);
    sum += std::sqrt(SquaredSampsonError(E, points.x1, points.x2));
  }
  return sum / (kNumAll - begin) * instance.camera.MeanFocal();
}

std::string_view SolverName(Solver solver) {
  static constexpr std::string_view kNames[kNumSolvers] = {"5PT", "2AC", "1AC+D (Umeyama)",
                                                           "1AC+D (Proposed)", "2AC+5PT"};
  return kNames[static_cast<int>(solver)];
}

int SampleSize(Solver solver) {
  return WithSolverType(solver, []<class SolverType>() { return SolverType::kSampleSize; });
}

std::optional<Rigid3d> EstimatePose(Solver solver, const Instance& noisy) {
  return WithSolverType(solver, [&]<class SolverType>() -> std::optional<Rigid3d> {
    const auto sample = SampleOf<SolverType>(noisy);
    typename SolverType::Model models[SolverType::kMaxSolutions];
    const int count = SolverType::Solve(sample.data(), models);
    if constexpr (std::is_same_v<typename SolverType::Model, ScaledPose>) {
      if (count == 0) return std::nullopt;
      return models[0].cam2_from_cam1;
    } else {
      // 2AC's linear form returns a matrix that is essential only for exact data.
      return SelectPose(models, count, solver != Solver::kTwoAffine, noisy);
    }
  });
}

}  // namespace cairn::experiments
