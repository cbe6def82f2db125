#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

#include "math/normal_equations.h"
#include "math/positive_definite.h"

namespace cairn {

// How the damping changes with each step.
enum class DampingRule {
  kTenfold,    // falls tenfold with every step that lowers the cost, grows tenfold with every other
  kGainRatio,  // by how much of the gain that the model promised a step brought (Nielsen, "Damping
               // parameter in Marquardt's method", 1999): it stays in the valley where it began
};

struct LevenbergMarquardtOptions {
  int max_iterations = 50;  // steps tried
  // A step that brings less than this share of the cost is the last.
  double min_relative_gain = 1e-6;
  double initial_damping = 1e-3;
  DampingRule damping_rule = DampingRule::kTenfold;
};

struct LevenbergMarquardtReport {
  double cost = 0.0;
  int num_iterations = 0;  // steps tried
  int num_accepted = 0;    // that lowered the cost
};

// The step that minimizes the model with every direction's own curvature raised by the share
// `damping` (Marquardt, 1963). A direction that hardly anything sees counts as one with a billionth
// of the largest curvature. False if the model is not a number or has no curvature at all.
template <int N>
bool DampedStep(const NormalEquations<N>& model, double damping,
                Eigen::Matrix<double, N, 1>* step) {
  constexpr double kMinCurvature = 1e-9;
  Eigen::Matrix<double, N, N> damped = model.hessian;
  const double floor = kMinCurvature * damped.diagonal().maxCoeff();
  for (int i = 0; i < N; ++i) damped(i, i) += damping * std::max(damped(i, i), floor);
  return SolvePositive<N>(damped, -model.gradient, step);
}

// The damping of one minimization.
class Damping {
 public:
  Damping(DampingRule rule, double initial) : rule_(rule), value_(initial) {}

  double value() const { return value_; }
  // Did a step gain enough?
  bool Accepts(double gain, double promised) const {
    constexpr double kMinShare = 1e-3;
    return gain > (rule_ == DampingRule::kGainRatio ? kMinShare * promised : 0.0);
  }
  void Grow() {
    value_ *= growth_;
    if (rule_ == DampingRule::kGainRatio) growth_ *= 2.0;
  }
  void Accept(double gain, double promised) {
    constexpr double kMin = 1e-8;
    if (rule_ == DampingRule::kTenfold) {
      value_ *= 0.1;
    } else {
      value_ *= std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * gain / promised - 1.0, 3));
      growth_ = 2.0;
    }
    value_ = std::max(value_, kMin);
  }

 private:
  DampingRule rule_;
  double value_;
  double growth_ = rule_ == DampingRule::kTenfold ? 10.0 : 2.0;
};

// Levenberg and Marquardt's method from `state` on, which is never made worse. A problem gives
//   State                       what is sought
//   Linearize(state) -> Model   with members cost (squared errors) and gradient (half the cost's),
//                               as NormalEquations; it may complete what of the state follows from
//                               the rest
//   Moved(state, step) -> State
// and, where it has its own,
//   Solve(model, damping, &step) -> bool   in place of DampedStep
//   Cost(state) -> double                  cheaper than Linearize, for what may be the last step
//   Accelerate(model, &step)               adds half the acceleration of the way that the step
//                                          begins, so that it follows the bends of a valley
//                                          (Transtrum and Sethna, "Improvements to the
//                                          Levenberg-Marquardt algorithm", 2012); called after
//                                          Solve, once a step was in vain
// It ends with a small gain (see the options), when nothing lowers the cost, and on NaN.
template <class Problem>
LevenbergMarquardtReport Minimize(Problem& problem, const LevenbergMarquardtOptions& options,
                                  typename Problem::State* state) {
  constexpr double kMaxDamping = 1e6;
  // Of the gain that ends it: what a step promises that is not worth trying, and one after which
  // the end is near.
  constexpr double kNegligible = 1e-3, kProbablyLast = 2.0;
  constexpr bool kHasCost = requires { problem.Cost(*state); };
  auto model = problem.Linearize(*state);
  LevenbergMarquardtReport report;
  report.cost = model.cost;
  Damping damping(options.damping_rule, options.initial_damping);
  bool was_in_vain = false;  // a step: the model is a poor one where it leads
  while (report.num_iterations < options.max_iterations && damping.value() <= kMaxDamping) {
    ++report.num_iterations;
    std::decay_t<decltype(model.gradient)> step;
    bool is_solved;
    if constexpr (requires { problem.Solve(model, damping.value(), &step); }) {
      is_solved = problem.Solve(model, damping.value(), &step);
    } else {
      is_solved = DampedStep(model, damping.value(), &step);
    }
    if (!is_solved) {
      damping.Grow();
      continue;
    }
    const double min_gain = options.min_relative_gain * report.cost;
    const double promised = -model.gradient.dot(step);
    if (!(promised > kNegligible * min_gain)) break;  // also when not finite
    if constexpr (requires { problem.Accelerate(model, &step); }) {
      if (was_in_vain) problem.Accelerate(model, &step);
    }
    typename Problem::State next = problem.Moved(*state, step);
    const bool is_last = report.num_iterations == options.max_iterations;
    // Nobody needs the derivatives at the end.
    const bool only_cost = kHasCost && (is_last || promised < kProbablyLast * min_gain);
    decltype(model) next_model;
    if constexpr (kHasCost) {
      if (only_cost) next_model.cost = problem.Cost(next);
    }
    if (!only_cost) next_model = problem.Linearize(next);
    const double gain = report.cost - next_model.cost;
    if (!damping.Accepts(gain, promised)) {
      was_in_vain = true;
      damping.Grow();
      continue;
    }
    *state = std::move(next);
    report.cost = next_model.cost;
    ++report.num_accepted;
    if (is_last || gain < min_gain) break;
    model = only_cost ? problem.Linearize(*state) : std::move(next_model);
    damping.Accept(gain, promised);
  }
  return report;
}

}  // namespace cairn
