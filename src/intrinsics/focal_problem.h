#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "intrinsics/kruppa.h"
#include "intrinsics/sparse_normals.h"
#include "math/normal_equations.h"

namespace cairn::internal {

// One pair of the problem. A camera's index; -1 stands for a trusted camera, whose focal length is
// the nominal one. Principal points have standard deviations in units of nominal focal lengths.
struct FocalTerm {
  int camera1 = -1;
  int camera2 = -1;
  Eigen::Vector2d principal_point_sigmas;
  PointPairs points;  // rays by nominal intrinsics
  FundamentalFit fit;
};

struct FocalSolution {
  std::vector<double> log_focals;    // of true over nominal focal lengths, by camera
  std::vector<double> sigmas;        // of these, at least as wide as their profile
  std::vector<int> num_terms_of;     // terms of a camera
  std::vector<int> num_agreeing_of;  // terms of a camera that agree with the solution
  int num_terms = 0;
  int num_agreeing = 0;
};

// Minimizes the sum of rho(r^T Sigma^-1 r) over the terms' Kruppa residuals r and of the priors:
// rho((log focal / its sigma)^2), and the squared principal points in their sigmas. rho is Geman
// and McClure's loss, Sigma that of the present intrinsics. A camera's principal point is the same
// in all of its pairs: where optical axes meet in one point at one distance, as around an object,
// any focal length fits with some principal point, and many pairs say no more than one.
class FocalProblem {
 public:
  FocalProblem(std::vector<FocalTerm> terms, std::vector<double> prior_sigmas);

  FocalSolution Solve(int num_threads) const;

 private:
  // Of camera v: its log focal length at v, its principal point, in its sigmas, from n + 2 v on.
  using State = Eigen::VectorXd;
  // A term's share of it: log focal length and principal point of either camera.
  static constexpr int kNumLocal = 6;
  using Local = Eigen::Matrix<double, kNumLocal, 1>;

  int NumCameras() const { return static_cast<int>(prior_sigmas_.size()); }
  int PrincipalPointAt(int camera) const { return NumCameras() + 2 * camera; }
  // Where the term's share is in the state; -1 of a trusted camera.
  std::array<int, kNumLocal> VariablesOf(const FocalTerm& term) const;
  Local LocalOf(const FocalTerm& term, const State& x) const;
  // The residual in its standard deviations, with the Sigma of its own intrinsics.
  Eigen::Vector2d Whitened(const FocalTerm& term, const State& x) const;
  double PriorLoss(const State& x, int camera) const;
  // Cost with each term's own Sigma: for comparing starts.
  double Cost(const State& x) const;
  // Finds the principal point that suits the camera's focal length, to first order; returns the
  // cost of its terms and priors.
  double FitPrincipalPoint(int camera, State& x) const;
  // Every camera in turn goes to its best focal length of a grid.
  void Search(int num_threads, State& x) const;
  // Levenberg-Marquardt.
  void Refine(int num_threads, State& x) const;
  // The same of what the terms' matches cost with the best E of the intrinsics, beyond what they
  // cost with F, in place of Kruppa's residuals, which are linear in the noise of F: where F is
  // known roughly, they make focal lengths too short.
  void RefineByMatches(int num_threads, State& x) const;
  // Of the camera's log focal length, by how far off one may be, with the principal point that
  // suits it and the other cameras as they are, before it costs three standard deviations more than
  // the best (profile likelihood: Venzon and Moolgavkar 1988). The curvature at the best does not
  // see that a long lens costs hardly more elsewhere. `excess`: of squared errors.
  double ProfileSigma(int camera, const State& best, double excess) const;
  // Gauss-Newton normal equations. Sigma changes with the intrinsics: one that is held makes focal
  // lengths too short, since the noise of F is in the residual and in its slope.
  SparseNormals Linearize(int num_threads, const State& x) const;
  // Of squared errors of the terms, with half of their derivatives, and of the priors.
  using LocalNormals = NormalEquations<kNumLocal>;  // with all of the hessian
  SparseNormals Sum(std::span<const LocalNormals> terms, const State& x) const;

  std::vector<FocalTerm> terms_;
  std::vector<double> prior_sigmas_;
  std::vector<std::vector<int>> terms_of_;  // by camera
};

}  // namespace cairn::internal
