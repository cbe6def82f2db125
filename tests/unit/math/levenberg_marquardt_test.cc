#include "math/levenberg_marquardt.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "cairn/base/rng.h"
#include "support/test.h"

namespace cairn {
namespace {

using Eigen::Vector2d;

// Rosenbrock's valley: errors steepness * (y - x^2) and 1 - x, least at (1, 1).
struct Rosenbrock {
  using State = Vector2d;
  double steepness = 10;
  NormalEquations<2> Linearize(const State& at) {
    NormalEquations<2> model;
    const double errors[2] = {steepness * (at.y() - at.x() * at.x()), 1 - at.x()};
    model.Add(errors[0], {-2 * steepness * at.x(), steepness}, 1);
    model.Add(errors[1], {-1, 0}, 1);
    model.cost = errors[0] * errors[0] + errors[1] * errors[1];
    costs.push_back(model.cost);
    return model;
  }
  State Moved(const State& from, const Vector2d& step) const { return from + step; }
  std::vector<double> costs;
};

TEST(Minimize, ConvergesOnRosenbrocksValley) {
  for (const DampingRule rule : {DampingRule::kTenfold, DampingRule::kGainRatio}) {
    Rosenbrock problem;
    Vector2d x(-1.2, 1);
    const auto report = Minimize(
        problem, {.max_iterations = 100, .min_relative_gain = 0, .damping_rule = rule}, &x);
    EXPECT_LT((x - Vector2d(1, 1)).norm(), 1e-12);
    EXPECT_LT(report.cost, 1e-24);
    EXPECT_LT(report.num_iterations, 60);
    EXPECT_LE(report.num_accepted, report.num_iterations);
  }
}

// The same with the second derivatives along a step, (-2 steepness step_x^2, 0).
struct BentRosenbrock : Rosenbrock {
  struct Model : NormalEquations<2> {
    Vector2d at;
  };
  Model Linearize(const State& at) { return {Rosenbrock::Linearize(at), at}; }
  bool Solve(const Model& model, double damping, Vector2d* step) {
    damping_ = damping;
    return DampedStep(model, damping, step);
  }
  void Accelerate(const Model& model, Vector2d* step) {
    Model of_bend = model;
    of_bend.gradient =
        -2 * steepness * step->x() * step->x() * Vector2d(-2 * steepness * model.at.x(), steepness);
    Vector2d acceleration;
    ASSERT_TRUE(DampedStep(of_bend, damping_, &acceleration));
    *step += 0.5 * acceleration;
    ++num_accelerated;
  }
  int num_accelerated = 0;

 private:
  double damping_ = 0;
};

TEST(Minimize, FollowsABentValleyByAcceleratedSteps) {
  const LevenbergMarquardtOptions options{
      .max_iterations = 10000, .min_relative_gain = 0, .damping_rule = DampingRule::kGainRatio};
  Rosenbrock straight;
  BentRosenbrock bent;
  straight.steepness = bent.steepness = 1000;
  Vector2d x(-1.2, 1), y(-1.2, 1);
  const auto report = Minimize(straight, options, &x);
  const auto accelerated = Minimize(bent, options, &y);
  EXPECT_LT((y - Vector2d(1, 1)).norm(), 1e-12);
  EXPECT_LT(2 * accelerated.num_iterations, report.num_iterations);
  EXPECT_GT(bent.num_accelerated, 0);
  EXPECT_LT(bent.num_accelerated, accelerated.num_iterations);  // not before a step was in vain
}

TEST(Minimize, NeverRaisesTheCostHoweverManySteps) {
  double before = std::numeric_limits<double>::infinity();
  for (int max_iterations = 0; max_iterations < 30; ++max_iterations) {
    Rosenbrock problem;
    Vector2d x(-1.2, 1);
    const auto report = Minimize(problem, {.max_iterations = max_iterations}, &x);
    EXPECT_LE(report.num_iterations, max_iterations);
    EXPECT_EQ(report.cost, problem.Linearize(x).cost);
    EXPECT_LE(report.cost, before);
    before = report.cost;
  }
}

TEST(Minimize, EndsWithTheFirstSmallGain) {
  Rosenbrock rough, fine;
  Vector2d x(-1.2, 1), y(-1.2, 1);
  EXPECT_LT(Minimize(rough, {.min_relative_gain = 0.3}, &x).num_iterations,
            Minimize(fine, {.min_relative_gain = 1e-3}, &y).num_iterations);
  EXPECT_LT(fine.costs.back(), rough.costs.back());
}

// A sine: beyond the nearest valley there are others.
struct Waves {
  using State = double;
  NormalEquations<1> Linearize(double at) const {
    NormalEquations<1> model;
    model.Add(1.5 + std::sin(at), NormalEquations<1>::Vector(std::cos(at)), 1);
    model.cost = std::pow(1.5 + std::sin(at), 2);
    return model;
  }
  State Moved(double from, const NormalEquations<1>::Vector& step) const { return from + step[0]; }
};

TEST(Minimize, StaysInItsValleyMoreOftenByTheGainRatio) {
  const auto num_left = [](DampingRule rule) {
    int num = 0;
    for (double start = -1.4; start < 1.4; start += 0.1) {
      Waves waves;
      double x = start;
      Minimize(waves, {.max_iterations = 200, .min_relative_gain = 0, .damping_rule = rule}, &x);
      EXPECT_NEAR(std::sin(x), -1, 1e-6);
      num += std::abs(x + 0.5 * std::numbers::pi) > 1;
    }
    return num;
  };
  EXPECT_LT(num_left(DampingRule::kGainRatio), num_left(DampingRule::kTenfold));
}

// A cost whose model lies.
struct Uphill {
  using State = double;
  NormalEquations<1> Linearize(double at) const {
    NormalEquations<1> model;
    model.Add(1.0, NormalEquations<1>::Vector(1.0), 1);
    model.cost = 1 - at;
    return model;
  }
  State Moved(double from, const NormalEquations<1>::Vector& step) const { return from + step[0]; }
};

TEST(Minimize, GivesUpWhereNothingLowersTheCost) {
  Uphill problem;
  double x = 0;
  const auto report = Minimize(problem, {.max_iterations = 1000, .min_relative_gain = 0}, &x);
  EXPECT_EQ(x, 0);
  EXPECT_EQ(report.num_accepted, 0);
  EXPECT_LT(report.num_iterations, 20);
}

// Where only the first of two directions is seen; beyond `end` there is nothing.
struct HalfSeen {
  using State = Vector2d;
  NormalEquations<2> Linearize(const State& at) const {
    NormalEquations<2> model;
    model.Add(at.x() - 3, {1, 0}, 1);
    model.cost = std::pow(at.x() - 3, 2);
    if (at.x() > end) model.cost = std::nan("");
    return model;
  }
  double Cost(const State& at) const { return Linearize(at).cost; }
  State Moved(const State& from, const Vector2d& step) const { return from + step; }
  double end = 100;
};

TEST(Minimize, LeavesAloneWhatNothingSees) {
  HalfSeen problem;
  Vector2d x(0, 7);
  Minimize(problem, {.min_relative_gain = 1e-12}, &x);
  EXPECT_NEAR(x.x(), 3, 1e-6);
  EXPECT_EQ(x.y(), 7);
}

TEST(Minimize, StopsShortOfWhatIsNotANumber) {
  HalfSeen problem{.end = 1.0};
  Vector2d x(0, 7);
  EXPECT_TRUE(std::isfinite(Minimize(problem, {}, &x).cost));
  EXPECT_LE(x.x(), 1.0);
  problem.end = -1.0;  // at the start
  const auto report = Minimize(problem, {}, &x);
  EXPECT_EQ(report.num_accepted, 0);
  EXPECT_LT(report.num_iterations, 20);
}

TEST(Minimize, StaysWhereThereIsNothingToDo) {
  struct Flat {
    using State = Vector2d;
    NormalEquations<2> Linearize(const State&) const { return {}; }
    State Moved(const State& from, const Vector2d& step) const { return from + step; }
  } problem;
  Vector2d x(1, 2);
  EXPECT_LT(Minimize(problem, {}, &x).num_iterations, 20);
  EXPECT_EQ(x, Vector2d(1, 2));
}

// It has a cheaper cost for the last step, and uses it for no other.
TEST(Minimize, AsksForTheCostAloneAtTheEnd) {
  struct Counting : HalfSeen {
    double Cost(const State& at) {
      ++num_costs;
      return HalfSeen::Cost(at);
    }
    int num_costs = 0;
  } problem;
  Vector2d x(0, 0);
  EXPECT_EQ(Minimize(problem, {.max_iterations = 2}, &x).num_accepted, 2);
  EXPECT_EQ(problem.num_costs, 1);
}

TEST(NormalEquations, AlongDirectionsIsTheChainRule) {
  Rng rng(1);
  NormalEquations<4> whole;
  NormalEquations<2> part;
  Eigen::Matrix<double, 4, 2> directions;
  for (int k = 0; k < 8; ++k) directions(k) = rng.Gaussian();
  for (int i = 0; i < 10; ++i) {
    NormalEquations<4>::Vector J;
    for (int k = 0; k < 4; ++k) J[k] = rng.Gaussian();
    const double error = rng.Gaussian(), weight = rng.Uniform(0, 2);
    whole.Add(error, J, weight);
    part.Add(error, directions.transpose() * J, weight);
  }
  whole.cost = 3;
  const NormalEquations<2> along = whole.Along<2>(directions);
  EXPECT_LT((along.gradient - part.gradient).norm(), 1e-12);
  for (int j = 0; j < 2; ++j) {
    for (int i = j; i < 2; ++i) EXPECT_NEAR(along.hessian(i, j), part.hessian(i, j), 1e-12);
  }
  EXPECT_EQ(along.cost, 3);
}

}  // namespace
}  // namespace cairn
