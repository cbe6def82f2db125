#include "robust/ransac.h"

#include <cmath>
#include <vector>

#include "support/test.h"

namespace cairn {
namespace {

// Lines y = a x + b through points: the mock that RANSAC is tested with.
struct Line {
  double a = 0.0, b = 0.0;
};

class LineEstimator {
 public:
  static constexpr int kSampleSize = 2;
  static constexpr int kMaxSolutions = 1;
  using Model = Line;

  LineEstimator(std::vector<double> x, std::vector<double> y)
      : x_(std::move(x)), y_(std::move(y)) {}
  int NumData() const { return static_cast<int>(x_.size()); }
  int Solve(const uint32_t* sample, Line* models) {
    const double dx = x_[sample[1]] - x_[sample[0]];
    if (dx == 0.0) return 0;
    models->a = (y_[sample[1]] - y_[sample[0]]) / dx;
    models->b = y_[sample[0]] - models->a * x_[sample[0]];
    return 1;
  }
  double Score(const Line& line, double bound) {
    ++num_scored;
    double sum = 0.0;
    for (size_t i = 0; i < x_.size(); ++i) {
      const double e = y_[i] - line.a * x_[i] - line.b;
      sum += std::max(0.0, 1.0 - e * e);
    }
    return sum > bound ? sum : -1.0;
  }
  double Optimize(Line& line, int* num_inliers) {
    double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (size_t i = 0; i < x_.size(); ++i) {
      if (std::abs(y_[i] - line.a * x_[i] - line.b) > 1.0) continue;
      n += 1, sx += x_[i], sy += y_[i], sxx += x_[i] * x_[i], sxy += x_[i] * y_[i];
    }
    *num_inliers = static_cast<int>(n);
    line.a = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    line.b = (sy - line.a * sx) / n;
    return Score(line, -1.0);
  }
  int num_scored = 0;

 private:
  std::vector<double> x_, y_;
};
static_assert(RansacEstimator<LineEstimator>);

LineEstimator MakeData(int num_inliers, int num_outliers, uint64_t seed) {
  Rng rng(seed);
  std::vector<double> x, y;
  for (int i = 0; i < num_inliers + num_outliers; ++i) {
    x.push_back(rng.Uniform(0.0, 100.0));
    y.push_back(i < num_inliers ? 2.0 * x.back() - 7.0 + 0.2 * rng.Gaussian()
                                : rng.Uniform(-500.0, 500.0));
  }
  return LineEstimator(x, y);
}

TEST(Ransac, FindsTheModelAmongOutliers) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    LineEstimator estimator = MakeData(50, 100, seed);
    Rng rng(seed, "ransac");
    const auto report = Ransac(estimator, RansacOptions{.confidence = 0.9999}, rng);
    ASSERT_TRUE(report.model.has_value());
    EXPECT_NEAR(report.model->a, 2.0, 0.02);
    EXPECT_NEAR(report.model->b, -7.0, 0.5);
    EXPECT_LT(report.num_iterations, 1000);
  }
}

TEST(Ransac, IsDeterministic) {
  LineEstimator a = MakeData(30, 100, 3), b = MakeData(30, 100, 3);
  Rng rng_a(5), rng_b(5);
  const auto report_a = Ransac(a, {}, rng_a), report_b = Ransac(b, {}, rng_b);
  EXPECT_EQ(report_a.model->a, report_b.model->a);
  EXPECT_EQ(report_a.num_iterations, report_b.num_iterations);
}

TEST(Ransac, MayEndWithoutAModelOrWithoutConfidence) {
  LineEstimator too_few({1.0}, {1.0});
  Rng rng(1);
  EXPECT_FALSE(Ransac(too_few, {}, rng).model.has_value());

  LineEstimator vertical({1.0, 1.0, 1.0}, {1.0, 2.0, 3.0});
  const auto none = Ransac(vertical, RansacOptions{.max_iterations = 50}, rng);
  EXPECT_FALSE(none.model.has_value());
  EXPECT_EQ(none.num_iterations, 50);

  LineEstimator hard = MakeData(5, 300, 1);
  const auto exhausted =
      Ransac(hard, RansacOptions{.min_iterations = 1, .max_iterations = 20}, rng);
  EXPECT_TRUE(exhausted.model.has_value());
  EXPECT_EQ(exhausted.num_iterations, 20);
}

TEST(Ransac, HasToBeatTheInitialScore) {
  LineEstimator estimator = MakeData(50, 20, 2);
  Rng rng(1);
  const auto report = Ransac(estimator, RansacOptions{.initial_score = 69.0}, rng);
  EXPECT_FALSE(report.model.has_value());
}

TEST(Ransac, IterationBoundsHold) {
  LineEstimator estimator = MakeData(100, 0, 2);
  Rng rng(1);
  EXPECT_EQ(Ransac(estimator, RansacOptions{.min_iterations = 77}, rng).num_iterations, 77);
  EXPECT_LE(Ransac(estimator, RansacOptions{.min_iterations = 1}, rng).num_iterations, 5);
}

TEST(NumRansacIterations, AgreesWithTheFormula) {
  EXPECT_EQ(NumRansacIterations(0.5, 5, 0.99), 146);
  EXPECT_EQ(NumRansacIterations(1.0, 5, 0.99), 1);
  EXPECT_GT(NumRansacIterations(0.0, 5, 0.99), int64_t{1} << 60);
  EXPECT_EQ(NumRansacIterations(0.5, 5, 0.0), 1);
}

}  // namespace
}  // namespace cairn
