#include "intrinsics/focal_problem.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "cairn/math/median.h"
#include "math/levenberg_marquardt.h"

namespace cairn::internal {
namespace {

// The squared residual, in standard deviations, up to which a pair agrees: 99 % of right ones (two
// equations).
constexpr double kMaxSquaredError = 9.21;
// What F's covariance does not know: distortion, matches that hang together.
constexpr double kModelSigma = 0.005;
constexpr int kMaxSweeps = 3;
constexpr int kMaxRounds = 4;
constexpr int kMaxIterations = 30;
constexpr double kMinRelativeGain = 1e-10;
// A step that doubles a focal length leaves where the linearization holds.
constexpr double kMaxStep = 0.7;
// The median of a squared residual of two equations.
constexpr double kChiSquareMedian = 1.386;

// Geman and McClure's loss: a pair or a guess that is far off pulls no more.
double Loss(double squared) { return squared / (1.0 + squared / kMaxSquaredError); }
double LossWeight(double squared) {
  const double weight = 1.0 / (1.0 + squared / kMaxSquaredError);
  return weight * weight;
}

Eigen::Matrix2d TermInformation(const FocalTerm& term, const Eigen::Vector2d& log_focals) {
  Eigen::Matrix2d covariance = KruppaCovariance(term.fit, log_focals, term.principal_point_sigmas);
  covariance.diagonal().array() += kModelSigma * kModelSigma;
  return covariance.inverse();
}

}  // namespace

FocalProblem::FocalProblem(std::vector<FocalTerm> terms, std::vector<double> prior_sigmas)
    : terms_(std::move(terms)),
      prior_sigmas_(std::move(prior_sigmas)),
      terms_of_(prior_sigmas_.size()) {
  for (size_t i = 0; i < terms_.size(); ++i) {
    const auto [v1, v2] = std::pair(terms_[i].variable1, terms_[i].variable2);
    if (v1 >= 0) terms_of_[v1].push_back(static_cast<int>(i));
    if (v2 >= 0 && v2 != v1) terms_of_[v2].push_back(static_cast<int>(i));
  }
}

double FocalProblem::SquaredError(const FocalTerm& term, const Eigen::VectorXd& x) const {
  const Eigen::Vector2d log_focals = LogFocals(term, x);
  const Eigen::Vector2d r = EvaluateKruppa(term.fit, log_focals).value;
  return r.dot(TermInformation(term, log_focals) * r);
}

double FocalProblem::PriorLoss(const Eigen::VectorXd& x, size_t v) const {
  return Loss(std::pow(x[v] / prior_sigmas_[v], 2));
}

double FocalProblem::Cost(const Eigen::VectorXd& x) const {
  double cost = 0;
  for (const FocalTerm& term : terms_) cost += Loss(SquaredError(term, x));
  for (size_t v = 0; v < prior_sigmas_.size(); ++v) {
    cost += PriorLoss(x, v);
  }
  return cost;
}

void FocalProblem::Search(Eigen::VectorXd& x) const {
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    bool changed = false;
    for (int v = 0; v < x.size(); ++v) {
      const double before = x[v];
      double best_cost = 0, best = before;
      // From 0.2 to 7 image sides, if the guess is 1.2.
      for (int k = -1; k <= 24; ++k) {
        x[v] = k < 0 ? before : 0.15 * (k - 12);
        double cost = PriorLoss(x, v);
        for (const int t : terms_of_[v]) cost += Loss(SquaredError(terms_[t], x));
        if (k >= 0 && !(cost < best_cost)) continue;
        best_cost = cost;
        best = x[v];
      }
      x[v] = best;
      changed |= best != before;
    }
    if (!changed) break;
  }
}

std::vector<Eigen::Matrix2d> FocalProblem::Information(const Eigen::VectorXd& x) const {
  std::vector<Eigen::Matrix2d> information;
  for (const FocalTerm& term : terms_) {
    information.push_back(TermInformation(term, LogFocals(term, x)));
  }
  return information;
}

SparseNormals FocalProblem::Linearize(const Eigen::VectorXd& x,
                                      const std::vector<Eigen::Matrix2d>& information) const {
  std::vector<Eigen::Triplet<double>> entries;
  SparseNormals model;
  model.gradient.setZero(x.size());
  for (size_t i = 0; i < terms_.size(); ++i) {
    const KruppaResidual residual = EvaluateKruppa(terms_[i].fit, LogFocals(terms_[i], x));
    const double squared = residual.value.dot(information[i] * residual.value);
    model.cost += Loss(squared);
    const Eigen::Matrix2d weight = LossWeight(squared) * information[i];
    const int variables[] = {terms_[i].variable1, terms_[i].variable2};
    for (int a = 0; a < 2; ++a) {
      if (variables[a] < 0) continue;
      const Eigen::Vector2d weighted = weight * residual.by_log_focals.col(a);
      model.gradient[variables[a]] += weighted.dot(residual.value);
      for (int b = 0; b < 2; ++b) {
        if (variables[b] < 0) continue;
        entries.emplace_back(variables[a], variables[b],
                             weighted.dot(residual.by_log_focals.col(b)));
      }
    }
  }
  for (size_t v = 0; v < prior_sigmas_.size(); ++v) {
    const double squared = std::pow(x[v] / prior_sigmas_[v], 2);
    const double precision = LossWeight(squared) / (prior_sigmas_[v] * prior_sigmas_[v]);
    model.cost += Loss(squared);
    model.gradient[static_cast<Eigen::Index>(v)] += precision * x[v];
    entries.emplace_back(static_cast<int>(v), static_cast<int>(v), precision);
  }
  model.hessian.resize(x.size(), x.size());
  model.hessian.setFromTriplets(entries.begin(), entries.end());
  return model;
}

void FocalProblem::Refine(Eigen::VectorXd& x) const {
  struct Problem {
    using State = Eigen::VectorXd;
    SparseNormals Linearize(const State& at) const { return all.Linearize(at, information); }
    State Moved(const State& from, const Eigen::VectorXd& step) const { return from + step; }
    bool Solve(const SparseNormals& model, double damping, Eigen::VectorXd* step) const {
      return model.DampedStep(damping, kMaxStep, step);
    }
    const FocalProblem& all;
    std::vector<Eigen::Matrix2d> information;
  };
  for (int round = 0; round < kMaxRounds; ++round) {
    Problem problem{*this, Information(x)};
    const Eigen::VectorXd before = x;
    Minimize(problem, {kMaxIterations, kMinRelativeGain}, &x);
    if ((x - before).cwiseAbs().maxCoeff() < 1e-4) break;
  }
}

FocalSolution FocalProblem::Solve() {
  FocalSolution solution;
  const auto n = static_cast<Eigen::Index>(prior_sigmas_.size());
  solution.num_agreeing_of.assign(prior_sigmas_.size(), 0);
  for (const auto& terms : terms_of_) {
    solution.num_terms_of.push_back(static_cast<int>(terms.size()));
  }
  solution.num_terms = static_cast<int>(terms_.size());
  if (n == 0) return solution;
  Eigen::VectorXd best;
  double best_cost = 0;
  for (const double start : {0.0, -0.5, 0.5}) {
    Eigen::VectorXd x = Eigen::VectorXd::Constant(n, start);
    Search(x);
    Refine(x);
    const double cost = Cost(x);
    if (best.size() > 0 && !(cost < best_cost)) continue;
    best_cost = cost;
    best = x;
  }
  std::vector<double> squared_errors;
  for (const FocalTerm& term : terms_) {
    squared_errors.push_back(SquaredError(term, best));
    if (squared_errors.back() > kMaxSquaredError) continue;
    ++solution.num_agreeing;
    if (term.variable1 >= 0) ++solution.num_agreeing_of[term.variable1];
    if (term.variable2 >= 0 && term.variable2 != term.variable1) {
      ++solution.num_agreeing_of[term.variable2];
    }
  }
  const SparseNormals model = Linearize(best, Information(best));
  // Where most pairs contradict what their matches promise, the promise is worth less.
  const double excess = std::max(1.0, UpperMedian(squared_errors) / kChiSquareMedian);
  for (Eigen::Index v = 0; v < n; ++v) {
    solution.log_focals.push_back(best[v]);
    solution.sigmas.push_back(std::sqrt(excess * model.LocalVariance(v)));
  }
  return solution;
}

}  // namespace cairn::internal
