#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <type_traits>

#include "cairn/base/check.h"
#include "cairn/solvers/five_point.h"
#include "cairn/solvers/one_affine_depth.h"
#include "cairn/solvers/two_affine.h"
#include "relative_pose_experiments/paper_setup.h"

namespace cairn::experiments {

// The paper's four solvers, and our own form of the second.
enum class Solver : int {
  kFivePoint = 0,
  kTwoAffine,           // Barath and Hajder 2018, linear in the monomials
  kUmeyama,             // 1AC+D
  kProposed,            // 1AC+D
  kTwoAffineFivePoint,  // 2AC's equations, with exact essential matrices
};
inline constexpr int kNumSolvers = 5;
inline constexpr std::array<Solver, kNumSolvers> kAllSolvers = {
    Solver::kFivePoint, Solver::kTwoAffine, Solver::kUmeyama, Solver::kProposed,
    Solver::kTwoAffineFivePoint};

// As the paper calls it: "5PT", "2AC", "1AC+D (Umeyama)", "1AC+D (Proposed)"; ours: "2AC+5PT".
std::string_view SolverName(Solver solver);
// The number of correspondences in a sample.
int SampleSize(Solver solver);

// Calls fn.operator()<the solver's type>().
template <class Fn>
auto WithSolverType(Solver solver, const Fn& fn) {
  switch (solver) {
    case Solver::kFivePoint:
      return fn.template operator()<FivePoint>();
    case Solver::kTwoAffine:
      return fn.template operator()<TwoAffine>();
    case Solver::kUmeyama:
      return fn.template operator()<OneAffineDepthUmeyama>();
    case Solver::kProposed:
      return fn.template operator()<OneAffineDepthProposed>();
    case Solver::kTwoAffineFivePoint:
      break;
  }
  CAIRN_CHECK(solver == Solver::kTwoAffineFivePoint);
  return fn.template operator()<TwoAffineFivePoint>();
}

// The instance's first correspondences in the form that the solver takes.
template <class SolverType>
std::array<typename SolverType::Sample, SolverType::kSampleSize> SampleOf(
    const Instance& instance) {
  std::array<typename SolverType::Sample, SolverType::kSampleSize> sample;
  for (int i = 0; i < SolverType::kSampleSize; ++i) {
    if constexpr (std::is_same_v<typename SolverType::Sample, PointCorrespondence>) {
      sample[i] = PointsOf(instance, i);
    } else if constexpr (std::is_same_v<typename SolverType::Sample, AffineCorrespondence>) {
      sample[i] = AffineOf(instance, i);
    } else {
      sample[i] = LiftedOf(instance, i);
    }
  }
  return sample;
}

// A solver's answer for the instance's first correspondences. Among several solutions, the one with
// the least mean Sampson error over the instance's other correspondences counts, as in a robust
// estimator, and among the four poses of an essential matrix, the one with the most points in front
// of both cameras. Absent if the solver returns no model.
std::optional<Rigid3d> EstimatePose(Solver solver, const Instance& noisy);

// Mean Sampson error of the instance's correspondences from `begin` on.
double MeanSampsonPx(const Eigen::Matrix3d& E, const Instance& instance, int begin);

}  // namespace cairn::experiments
