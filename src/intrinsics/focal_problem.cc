#include "intrinsics/focal_problem.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "cairn/base/parallel.h"
#include "cairn/math/median.h"
#include "intrinsics/essential_term.h"
#include "math/levenberg_marquardt.h"

namespace cairn::internal {
namespace {

// The squared residual, in standard deviations, up to which a pair agrees: 99 % of right ones (two
// equations).
constexpr double kMaxSquaredError = 9.21;
// What F's covariance does not know: distortion, matches that hang together.
constexpr double kModelSigma = 0.005;
constexpr int kMaxSweeps = 3;
constexpr int kGrain = 64;  // terms that a thread takes at a time
constexpr int kPointIterations = 3;
constexpr int kMaxIterations = 100;
constexpr double kMinRelativeGain = 1e-10;
constexpr double kMinRelativeGainByMatches = 1e-5;
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

// Of squared errors: where most pairs contradict what their matches promise, the promise is worth
// less.
double Excess(std::vector<double> squared_errors) {
  return std::max(1.0, UpperMedian(std::move(squared_errors)) / kChiSquareMedian);
}

double Squared(const Eigen::Vector2d& r, const Eigen::Matrix2d& information) {
  return r.dot(information * r);
}

// Log focal length and principal point of both cameras.
using TermState = Eigen::Matrix<double, 6, 1>;

KruppaEquations EquationsAt(const FocalTerm& term, const TermState& x) {
  Eigen::Vector4d points;
  points << term.principal_point_sigmas[0] * x.segment<2>(1),
      term.principal_point_sigmas[1] * x.segment<2>(4);
  return {term.fit, {x[0], x[3]}, points};
}

// Changes of the residual with the principal points, in their sigmas.
Eigen::Matrix<double, 2, 4> ByPrincipalPoints(const FocalTerm& term,
                                              const KruppaEquations& equations) {
  Eigen::Matrix<double, 2, 4> by = equations.ByPrincipalPoints();
  by.leftCols<2>() *= term.principal_point_sigmas[0];
  by.rightCols<2>() *= term.principal_point_sigmas[1];
  return by;
}

// Sigma: principal points of trusted cameras are unknown in it.
Eigen::Matrix2d Covariance(const FocalTerm& term, const KruppaEquations& equations) {
  Eigen::Matrix2d covariance = equations.Covariance();
  covariance.diagonal().array() += kModelSigma * kModelSigma;
  if (term.camera1 >= 0 && term.camera2 >= 0) return covariance;
  const Eigen::Matrix<double, 2, 4> by = ByPrincipalPoints(term, equations);
  const auto add = [&](const Eigen::Matrix2d& by_one) {
    covariance += by_one * by_one.transpose();
  };
  if (term.camera1 < 0) add(by.leftCols<2>());
  if (term.camera2 < 0) add(by.rightCols<2>());
  return covariance;
}

Eigen::Vector2d WhitenedAt(const FocalTerm& term, const TermState& x) {
  const KruppaEquations equations = EquationsAt(term, x);
  return Covariance(term, equations).llt().matrixL().solve(equations.Residual());
}

struct LinearResidual {
  Eigen::Vector2d value;
  Eigen::Matrix<double, 2, 6> by;
};

// WhitenedAt, and its changes with the term's share of the state, by differences. One camera's, of
// a term with itself, are in the first columns.
LinearResidual LinearizeAt(const FocalTerm& term, const TermState& x) {
  constexpr double kStep = 1e-6;
  LinearResidual linear = {WhitenedAt(term, x), Eigen::Matrix<double, 2, 6>::Zero()};
  const bool is_one_camera = term.camera1 == term.camera2;
  for (int k = 0; k < (is_one_camera ? 3 : 6); ++k) {
    if ((k < 3 ? term.camera1 : term.camera2) < 0) continue;
    TermState moved = x;
    moved[k] += kStep;
    if (is_one_camera) moved[k + 3] += kStep;
    linear.by.col(k) = (WhitenedAt(term, moved) - linear.value) / kStep;
  }
  return linear;
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

std::array<int, FocalProblem::kNumLocal> FocalProblem::VariablesOf(const FocalTerm& term) const {
  std::array<int, kNumLocal> variables;
  variables.fill(-1);
  const int cameras[] = {term.camera1, term.camera2};
  for (int k = 0; k < 2; ++k) {
    if (cameras[k] < 0) continue;
    const int point = PrincipalPointAt(cameras[k]);
    std::ranges::copy(std::array{cameras[k], point, point + 1}, variables.begin() + 3 * k);
  }
  return variables;
}

FocalProblem::Local FocalProblem::LocalOf(const FocalTerm& term, const State& x) const {
  const std::array<int, kNumLocal> variables = VariablesOf(term);
  Local local;
  for (int k = 0; k < kNumLocal; ++k) local[k] = variables[k] < 0 ? 0.0 : x[variables[k]];
  return local;
}

Eigen::Vector2d FocalProblem::Whitened(const FocalTerm& term, const State& x) const {
  return WhitenedAt(term, LocalOf(term, x));
}

double FocalProblem::PriorLoss(const State& x, int camera) const {
  return Loss(std::pow(x[camera] / prior_sigmas_[camera], 2)) +
         x.segment<2>(PrincipalPointAt(camera)).squaredNorm();
}

double FocalProblem::Cost(const State& x) const {
  double cost = 0;
  for (const FocalTerm& term : terms_) cost += Loss(Whitened(term, x).squaredNorm());
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
    const KruppaEquations equations = EquationsAt(terms_[t], LocalOf(terms_[t], x));
    const Eigen::Matrix2d covariance = Covariance(terms_[t], equations);
    const Eigen::Matrix<double, 2, 4> by_points = ByPrincipalPoints(terms_[t], equations);
    Eigen::Matrix2d by = Eigen::Matrix2d::Zero();
    if (terms_[t].camera1 == camera) by += by_points.leftCols<2>();
    if (terms_[t].camera2 == camera) by += by_points.rightCols<2>();
    terms.push_back({equations.Residual(), by, covariance.inverse(),
                     (covariance + by * by.transpose()).inverse()});
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

SparseNormals FocalProblem::Linearize(int num_threads, const State& x) const {
  std::vector<LocalNormals> terms(terms_.size());
  ParallelFor(
      num_threads, std::ssize(terms_),
      [&](int64_t i) {
        const auto& [value, by] = LinearizeAt(terms_[i], LocalOf(terms_[i], x));
        terms[i].cost = value.squaredNorm();
        terms[i].gradient = by.transpose() * value;
        terms[i].hessian = by.transpose() * by;
      },
      kGrain);
  return Sum(terms, x);
}

SparseNormals FocalProblem::Sum(std::span<const LocalNormals> terms, const State& x) const {
  std::vector<Eigen::Triplet<double>> entries;
  SparseNormals model;
  model.gradient.setZero(x.size());
  for (size_t i = 0; i < terms_.size(); ++i) {
    model.cost += Loss(terms[i].cost);
    const double weight = LossWeight(terms[i].cost);
    const std::array<int, kNumLocal> variables = VariablesOf(terms_[i]);
    for (int a = 0; a < kNumLocal; ++a) {
      if (variables[a] < 0) continue;
      model.gradient[variables[a]] += weight * terms[i].gradient[a];
      for (int b = 0; b < kNumLocal; ++b) {
        if (variables[b] < 0) continue;
        entries.emplace_back(variables[a], variables[b], weight * terms[i].hessian(a, b));
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

void FocalProblem::Refine(int num_threads, State& x) const {
  struct Problem {
    using State = Eigen::VectorXd;
    SparseNormals Linearize(const State& at) const { return all.Linearize(num_threads, at); }
    State Moved(const State& from, const Eigen::VectorXd& step) const { return from + step; }
    bool Solve(const SparseNormals& model, double damping, Eigen::VectorXd* step) const {
      return model.DampedStep(damping, kMaxStep, step);
    }
    const FocalProblem& all;
    int num_threads;
  };
  Problem problem{*this, num_threads};
  Minimize(problem, {kMaxIterations, kMinRelativeGain}, &x);
}

void FocalProblem::RefineByMatches(int num_threads, State& x) const {
  struct Problem {
    struct State {
      Eigen::VectorXd x;
      std::vector<EssentialTerm> terms;
    };
    SparseNormals Linearize(State& at) const {
      std::vector<LocalNormals> terms(at.terms.size());
      ParallelFor(num_threads, std::ssize(terms), [&](int64_t i) {
        terms[i] = at.terms[i].Reduce(all.LocalOf(all.terms_[i], at.x));
      });
      return all.Sum(terms, at.x);
    }
    State Moved(const State& from, const Eigen::VectorXd& step) const {
      return {from.x + step, from.terms};
    }
    bool Solve(const SparseNormals& model, double damping, Eigen::VectorXd* step) const {
      return model.DampedStep(damping, kMaxStep, step);
    }
    const FocalProblem& all;
    int num_threads;
  };
  Problem::State state{x, {}};
  for (const FocalTerm& term : terms_) {
    state.terms.emplace_back(term.points, term.fit, term.principal_point_sigmas, LocalOf(term, x));
  }
  std::vector<double> squared_errors(terms_.size());
  ParallelFor(num_threads, std::ssize(terms_), [&](int64_t i) {
    const Local local = LocalOf(terms_[i], x);
    // What is doubtful of F beside its noise, is so of the matches' costs.
    const KruppaEquations equations = EquationsAt(terms_[i], local);
    state.terms[i].Doubt(Covariance(terms_[i], equations).trace() /
                         equations.CovarianceOfNoise().trace());
    squared_errors[i] = state.terms[i].Reduce(local).cost;
  });
  const double excess = Excess(std::move(squared_errors));
  for (EssentialTerm& term : state.terms) term.Doubt(excess);
  Problem problem{*this, num_threads};
  Minimize(problem, {kMaxIterations, kMinRelativeGainByMatches}, &state);
  x = std::move(state.x);
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
    Refine(num_threads, found[k]);
    costs[k] = Cost(found[k]);
  };
  ParallelFor(num_threads, std::ssize(kStarts), solve, 1);
  const State& best = found[std::ranges::min_element(costs) - costs.begin()];
  std::vector<double> squared_errors;
  for (const FocalTerm& term : terms_) {
    squared_errors.push_back(Whitened(term, best).squaredNorm());
    if (squared_errors.back() > kMaxSquaredError) continue;
    ++solution.num_agreeing;
    if (term.camera1 >= 0) ++solution.num_agreeing_of[term.camera1];
    if (term.camera2 >= 0 && term.camera2 != term.camera1) {
      ++solution.num_agreeing_of[term.camera2];
    }
  }
  const SparseNormals model = Linearize(num_threads, best);
  const double excess = Excess(std::move(squared_errors));
  State exact = best;
  RefineByMatches(num_threads, exact);
  solution.log_focals.assign(exact.data(), exact.data() + n);
  solution.sigmas.resize(n);
  ParallelFor(num_threads, n, [&](int64_t v) {
    const auto camera = static_cast<int>(v);
    solution.sigmas[v] = std::max(std::sqrt(excess * model.LocalVariance(camera)),
                                  ProfileSigma(camera, best, excess));
  });
  return solution;
}

}  // namespace cairn::internal
