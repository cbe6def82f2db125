#pragma once

#include <Eigen/Core>
#include <vector>

#include "intrinsics/kruppa.h"
#include "intrinsics/sparse_normals.h"

namespace cairn::internal {

// One pair of the problem. A variable is the logarithm of a camera's true over its nominal focal
// length; -1 stands for a trusted camera, whose logarithm is 0.
struct FocalTerm {
  int variable1 = -1;
  int variable2 = -1;
  Eigen::Vector2d principal_point_sigmas;
  FundamentalFit fit;
};

struct FocalSolution {
  std::vector<double> log_focals;
  std::vector<double> sigmas;        // of these
  std::vector<int> num_terms_of;     // terms of a variable
  std::vector<int> num_agreeing_of;  // terms of a variable that agree with the solution
  int num_terms = 0;
  int num_agreeing = 0;
};

// Minimizes the sum of rho(r^T Sigma^-1 r) over the terms' Kruppa residuals r and of
// rho((x / prior sigma)^2) over the variables x, with Geman and McClure's loss rho. Sigma is that
// of the present focal lengths.
class FocalProblem {
 public:
  FocalProblem(std::vector<FocalTerm> terms, std::vector<double> prior_sigmas);

  FocalSolution Solve();

 private:
  double LogFocal(int variable, const Eigen::VectorXd& x) const {
    return variable < 0 ? 0.0 : x[variable];
  }
  Eigen::Vector2d LogFocals(const FocalTerm& term, const Eigen::VectorXd& x) const {
    return {LogFocal(term.variable1, x), LogFocal(term.variable2, x)};
  }
  // Squared residual of one term, with the Sigma of its own focal lengths.
  double SquaredError(const FocalTerm& term, const Eigen::VectorXd& x) const;
  double PriorLoss(const Eigen::VectorXd& x, size_t v) const;
  // Cost with each term's own Sigma: for comparing starts.
  double Cost(const Eigen::VectorXd& x) const;
  // Every variable in turn goes to its best value of a grid.
  void Search(Eigen::VectorXd& x) const;
  // Levenberg-Marquardt with Sigma updated between its rounds.
  void Refine(Eigen::VectorXd& x) const;
  // Gauss-Newton normal equations with given inverse covariances of the terms.
  SparseNormals Linearize(const Eigen::VectorXd& x,
                          const std::vector<Eigen::Matrix2d>& information) const;
  std::vector<Eigen::Matrix2d> Information(const Eigen::VectorXd& x) const;

  std::vector<FocalTerm> terms_;
  std::vector<double> prior_sigmas_;
  std::vector<std::vector<int>> terms_of_;  // by variable
};

}  // namespace cairn::internal
