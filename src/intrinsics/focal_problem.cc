#include "intrinsics/focal_problem.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "cairn/base/parallel.h"
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
constexpr int kPointIterations = 3;
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

double Squared(const Eigen::Vector2d& r, const Eigen::Matrix2d& information) {
  return r.dot(information * r);
}

}  // namespace

FocalProblem::FocalProblem(std::vector<FocalTerm> terms, std::vector<double> prior_sigmas)
    : terms_(std::move(terms)),
      prior_sigmas_(std::move(prior_sigmas)),
      terms_of_(prior_sigmas_.size()) {
  for (size_t i = 0; i < terms_.size(); ++i) {
    const auto [v1, v2] = std::pair(terms_[i].camera1, terms_[i].camera2);
    if (v1 >= 0) terms_of_[v1].push_back(static_cast<int>(i));
    if (v2 >= 0 && v2 != v1) terms_of_[v2].push_back(static_cast<int>(i));
  }
}

Eigen::Vector2d FocalProblem::LogFocals(const FocalTerm& term, const State& x) const {
  const auto log_focal = [&](int camera) { return camera < 0 ? 0.0 : x[camera]; };
  return {log_focal(term.camera1), log_focal(term.camera2)};
}

Eigen::Vector4d FocalProblem::PrincipalPoints(const FocalTerm& term, const State& x) const {
  Eigen::Vector4d points = Eigen::Vector4d::Zero();
  const int cameras[] = {term.camera1, term.camera2};
  for (int k = 0; k < 2; ++k) {
    if (cameras[k] < 0) continue;
    points.segment<2>(2 * k) =
        term.principal_point_sigmas[k] * x.segment<2>(PrincipalPointAt(cameras[k]));
  }
  return points;
}

FocalProblem::Residual FocalProblem::Evaluate(const FocalTerm& term, const State& x) const {
  const KruppaResidual kruppa =
      EvaluateKruppa(term.fit, LogFocals(term, x), PrincipalPoints(term, x));
  Residual residual{kruppa.value, {}, {term.camera1, term.camera2}};
  residual.by.leftCols<2>() = kruppa.by_log_focals;
  for (int k = 0; k < 2; ++k) {
    const int camera = k == 0 ? term.camera1 : term.camera2;
    residual.by.middleCols<2>(2 + 2 * k) =
        term.principal_point_sigmas[k] * kruppa.by_principal_points.middleCols<2>(2 * k);
    for (int axis = 0; axis < 2; ++axis) {
      residual.variables[2 + 2 * k + axis] = camera < 0 ? -1 : PrincipalPointAt(camera) + axis;
    }
  }
  return residual;
}

Eigen::Matrix2d FocalProblem::Covariance(const FocalTerm& term, const Residual& residual,
                                         const State& x) const {
  Eigen::Matrix2d covariance =
      KruppaCovariance(term.fit, LogFocals(term, x), PrincipalPoints(term, x));
  covariance.diagonal().array() += kModelSigma * kModelSigma;
  for (int k = 2; k < 6; ++k) {
    if (residual.variables[k] >= 0) continue;
    covariance += residual.by.col(k) * residual.by.col(k).transpose();
  }
  return covariance;
}

std::vector<Eigen::Matrix2d> FocalProblem::AllInformation(const State& x) const {
  std::vector<Eigen::Matrix2d> information;
  for (const FocalTerm& term : terms_) {
    information.push_back(Covariance(term, Evaluate(term, x), x).inverse());
  }
  return information;
}

double FocalProblem::SquaredError(const FocalTerm& term, const State& x) const {
  const Residual residual = Evaluate(term, x);
  return Squared(residual.value, Covariance(term, residual, x).inverse());
}

double FocalProblem::PriorLoss(const State& x, int camera) const {
  return Loss(std::pow(x[camera] / prior_sigmas_[camera], 2)) +
         x.segment<2>(PrincipalPointAt(camera)).squaredNorm();
}

double FocalProblem::Cost(const State& x) const {
  double cost = 0;
  for (const FocalTerm& term : terms_) cost += Loss(SquaredError(term, x));
  for (int v = 0; v < NumCameras(); ++v) cost += PriorLoss(x, v);
  return cost;
}

double FocalProblem::FitPrincipalPoint(int camera, State& x) const {
  auto point = x.segment<2>(PrincipalPointAt(camera));
  point.setZero();
  struct Linear {
    Eigen::Vector2d value;
    Eigen::Matrix2d by, information;
    Eigen::Matrix2d unsure;  // information with any likely principal point
    Eigen::Vector2d ValueAt(const Eigen::Vector2d& at) const { return value + by * at; }
  };
  std::vector<Linear> terms;
  for (const int t : terms_of_[camera]) {
    const Residual residual = Evaluate(terms_[t], x);
    const Eigen::Matrix2d covariance = Covariance(terms_[t], residual, x);
    Eigen::Matrix2d by = Eigen::Matrix2d::Zero();
    if (terms_[t].camera1 == camera) by += residual.by.middleCols<2>(2);
    if (terms_[t].camera2 == camera) by += residual.by.middleCols<2>(4);
    terms.push_back(
        {residual.value, by, covariance.inverse(), (covariance + by * by.transpose()).inverse()});
  }
  for (int k = 0; k < kPointIterations; ++k) {
    Eigen::Matrix2d hessian = Eigen::Matrix2d::Identity();
    Eigen::Vector2d gradient = point;
    for (const Linear& term : terms) {
      const Eigen::Vector2d value = term.ValueAt(point);
      const double squared = Squared(value, k == 0 ? term.unsure : term.information);
      const Eigen::Matrix2d weighted = LossWeight(squared) * term.information * term.by;
      hessian += term.by.transpose() * weighted;
      gradient += weighted.transpose() * value;
    }
    point -= hessian.inverse() * gradient;
  }
  double cost = PriorLoss(x, camera);
  for (const Linear& term : terms) cost += Loss(Squared(term.ValueAt(point), term.information));
  return cost;
}

void FocalProblem::Search(int num_threads, State& x) const {
  std::vector<char> is_open(NumCameras(), 1);
  // One for each focal length that is tried: the present one, and from 0.2 to 7 image sides, if the
  // guess is 1.2.
  std::array<State, 26> tried;
  tried.fill(x);
  std::array<double, tried.size()> costs;
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    for (int v = 0; v < NumCameras(); ++v) {
      if (!std::exchange(is_open[v], 0)) continue;
      const double before = tried[0][v];
      ParallelFor(num_threads, std::ssize(tried), [&](int64_t k) {
        if (k > 0) tried[k][v] = 0.15 * static_cast<double>(k - 13);
        costs[k] = FitPrincipalPoint(v, tried[k]);
      });
      const State& best = tried[std::ranges::min_element(costs) - costs.begin()];
      const double focal = best[v];
      const Eigen::Vector2d point = best.segment<2>(PrincipalPointAt(v));
      for (State& each : tried) {
        each[v] = focal;
        each.segment<2>(PrincipalPointAt(v)) = point;
      }
      if (focal == before) continue;
      for (const int t : terms_of_[v]) {
        for (const int other : {terms_[t].camera1, terms_[t].camera2}) {
          if (other >= 0 && other != v) is_open[other] = 1;
        }
      }
    }
  }
  x = std::move(tried[0]);
}

SparseNormals FocalProblem::Linearize(const State& x,
                                      const std::vector<Eigen::Matrix2d>& information) const {
  std::vector<Eigen::Triplet<double>> entries;
  SparseNormals model;
  model.gradient.setZero(x.size());
  for (size_t i = 0; i < terms_.size(); ++i) {
    const Residual residual = Evaluate(terms_[i], x);
    const double squared = Squared(residual.value, information[i]);
    model.cost += Loss(squared);
    const Eigen::Matrix<double, 2, 6> weighted = LossWeight(squared) * information[i] * residual.by;
    for (int a = 0; a < 6; ++a) {
      if (residual.variables[a] < 0) continue;
      model.gradient[residual.variables[a]] += weighted.col(a).dot(residual.value);
      for (int b = 0; b < 6; ++b) {
        if (residual.variables[b] < 0) continue;
        entries.emplace_back(residual.variables[a], residual.variables[b],
                             weighted.col(a).dot(residual.by.col(b)));
      }
    }
  }
  for (int v = 0; v < NumCameras(); ++v) {
    const double squared = std::pow(x[v] / prior_sigmas_[v], 2);
    const double precision = LossWeight(squared) / (prior_sigmas_[v] * prior_sigmas_[v]);
    model.cost += PriorLoss(x, v);
    model.gradient[v] += precision * x[v];
    entries.emplace_back(v, v, precision);
    for (int k = PrincipalPointAt(v); k < PrincipalPointAt(v) + 2; ++k) {
      model.gradient[k] += x[k];
      entries.emplace_back(k, k, 1.0);
    }
  }
  model.hessian.resize(x.size(), x.size());
  model.hessian.setFromTriplets(entries.begin(), entries.end());
  return model;
}

void FocalProblem::Refine(State& x) const {
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
    Problem problem{*this, AllInformation(x)};
    const State before = x;
    Minimize(problem, {kMaxIterations, kMinRelativeGain}, &x);
    if ((x - before).cwiseAbs().maxCoeff() < 1e-4) break;
  }
}

double FocalProblem::ProfileSigma(int camera, const State& best, double excess) const {
  constexpr double kSigmas = 3;
  constexpr double kStep = 0.075;
  constexpr int kNumSteps = 26;  // to a seventh and to seven times the nominal focal length
  State x = best;
  const auto cost_at = [&](double log_focal) {
    x[camera] = log_focal;
    return FitPrincipalPoint(camera, x);
  };
  const double largest = cost_at(best[camera]) + kSigmas * kSigmas * excess;
  double farthest = 0;
  for (int k = -kNumSteps; k <= kNumSteps; ++k) {
    const double distance = std::abs(kStep * k - best[camera]);
    if (distance > farthest && cost_at(kStep * k) <= largest) farthest = distance;
  }
  // (The prior's loss is robust.)
  return std::min(farthest / kSigmas, prior_sigmas_[camera]);
}

FocalSolution FocalProblem::Solve(int num_threads) const {
  FocalSolution solution;
  const int n = NumCameras();
  solution.num_agreeing_of.assign(prior_sigmas_.size(), 0);
  for (const auto& terms : terms_of_) {
    solution.num_terms_of.push_back(static_cast<int>(terms.size()));
  }
  solution.num_terms = static_cast<int>(terms_.size());
  if (n == 0) return solution;
  constexpr std::array kStarts = {0.0, -0.5, 0.5};
  std::array<State, kStarts.size()> found;
  std::array<double, kStarts.size()> costs;
  const auto solve = [&](int64_t k) {
    found[k] = State::Zero(3 * n);
    found[k].head(n).setConstant(kStarts[k]);
    Search(num_threads, found[k]);
    Refine(found[k]);
    costs[k] = Cost(found[k]);
  };
  ParallelFor(num_threads, std::ssize(kStarts), solve, 1);
  const State& best = found[std::ranges::min_element(costs) - costs.begin()];
  std::vector<double> squared_errors;
  for (const FocalTerm& term : terms_) {
    squared_errors.push_back(SquaredError(term, best));
    if (squared_errors.back() > kMaxSquaredError) continue;
    ++solution.num_agreeing;
    if (term.camera1 >= 0) ++solution.num_agreeing_of[term.camera1];
    if (term.camera2 >= 0 && term.camera2 != term.camera1) {
      ++solution.num_agreeing_of[term.camera2];
    }
  }
  const SparseNormals model = Linearize(best, AllInformation(best));
  // Where most pairs contradict what their matches promise, the promise is worth less.
  const double excess = std::max(1.0, UpperMedian(squared_errors) / kChiSquareMedian);
  solution.log_focals.assign(best.data(), best.data() + n);
  solution.sigmas.resize(n);
  ParallelFor(num_threads, n, [&](int64_t v) {
    const auto camera = static_cast<int>(v);
    solution.sigmas[v] = std::max(std::sqrt(excess * model.LocalVariance(camera)),
                                  ProfileSigma(camera, best, excess));
  });
  return solution;
}

}  // namespace cairn::internal
