#include "cairn/solvers/polynomial.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "cairn/base/check.h"

namespace cairn {
namespace {

constexpr int kMaxDegree = 10;

// Sturm's chain f_0 = p, f_1 = p', f_(i-1) = (slope_i x + offset_i) f_i - f_(i+1), kept as the
// quotients and the last, constant member, so that a value of the whole chain costs two products a
// member.
class SturmChain {
 public:
  SturmChain(const double* coefficients, int degree) {
    double a[kMaxDegree + 1], b[kMaxDegree + 1], r[kMaxDegree + 1];
    for (int i = 0; i <= degree; ++i) a[i] = coefficients[i];
    for (int i = 1; i <= degree; ++i) b[i - 1] = i * coefficients[i];
    int na = degree, nb = degree - 1;  // degrees
    while (nb > 0) {
      // Quotient of degree na - nb, which is one unless a leading coefficient vanished.
      const double slope = a[na] / b[nb];
      const double offset = (a[na - 1] - slope * b[nb - 1]) / b[nb];
      for (int i = 0; i < nb; ++i) {
        r[i] = offset * b[i] + (i > 0 ? slope * b[i - 1] : 0.0) - a[i];
      }
      slope_[length_] = slope;
      offset_[length_] = offset;
      ++length_;
      int nr = nb - 1;
      double largest = 0.0;
      for (int i = 0; i <= nr; ++i) largest = std::max(largest, std::abs(r[i]));
      while (nr > 0 && std::abs(r[nr]) <= 1e-14 * largest) --nr;
      if (largest == 0.0) {  // A common factor of p and p': a multiple root.
        last_ = 0.0;
        common_degree_ = nb;
        for (int i = 0; i <= nb; ++i) common_[i] = b[i];
        return;
      }
      for (int i = 0; i <= nb; ++i) a[i] = b[i];
      for (int i = 0; i <= nr; ++i) b[i] = r[i];
      na = nb;
      if (nr < nb - 1) {
        // The chain lost a degree: go on with the pair as a division of unequal degree, which the
        // linear quotient cannot express. Treat the remainder as if its leading term were tiny.
        for (int i = nr + 1; i < nb; ++i) b[i] = 0.0;
        b[nb - 1] = 1e-14 * largest;
        nr = nb - 1;
      }
      nb = nr;
    }
    slope_[length_] = a[1] / b[0];
    offset_[length_] = a[0] / b[0];
    ++length_;
    last_ = b[0];
  }

  // Numbers of sign changes of the chain at kWidth points side by side: the chain is a long
  // dependency, so several points take hardly more time than one.
  static constexpr int kWidth = 4;
  void SignChanges(const double* x, int* changes) const {
    double next[kWidth], value[kWidth];
    for (int k = 0; k < kWidth; ++k) {
      next[k] = 0.0;
      value[k] = last_;
      changes[k] = 0;
    }
    if (common_degree_ > 0) {
      for (int k = 0; k < kWidth; ++k) {
        value[k] = common_[common_degree_];
        for (int i = common_degree_ - 1; i >= 0; --i) value[k] = value[k] * x[k] + common_[i];
      }
    }
    for (int i = length_ - 1; i >= 0; --i) {
      for (int k = 0; k < kWidth; ++k) {
        const double previous = (slope_[i] * x[k] + offset_[i]) * value[k] - next[k];
        changes[k] += std::signbit(previous) != std::signbit(value[k]);
        next[k] = value[k];
        value[k] = previous;
      }
    }
  }

 private:
  double slope_[kMaxDegree], offset_[kMaxDegree];
  double common_[kMaxDegree + 1];
  double last_ = 0.0;
  int length_ = 0;
  int common_degree_ = 0;
};

double Evaluate(const double* c, int degree, double x) {
  double value = c[degree];
  for (int i = degree - 1; i >= 0; --i) value = value * x + c[i];
  return value;
}

// Brackets that hold one root each; all are refined side by side.
class Brackets {
 public:
  void Add(double low, double high, bool negative_low) {
    low_[count_] = low;
    high_[count_] = high;
    negative_low_[count_] = negative_low;
    ++count_;
  }
  int count() const { return count_; }

  // Newton's method, bisection where it leaves the bracket.
  void Refine(const double* c, int degree, double* roots) {
    for (int first = 0; first < count_; first += kWidth) {
      double refined[kWidth];
      RefineGroup(c, degree, first, refined);
      for (int k = first; k < std::min(first + kWidth, count_); ++k) roots[k] = refined[k - first];
    }
  }

 private:
  // As many at a time as hide the latency of Horner's rule.
  static constexpr int kWidth = 6;

  void RefineGroup(const double* c, int degree, int first, double* roots) const {
    using Values = Eigen::Array<double, kWidth, 1>;
    Values low, high, sign_low;
    for (int k = 0; k < kWidth; ++k) {
      const int from = std::min(first + k, count_ - 1);  // A short group repeats its last one.
      low[k] = low_[from];
      high[k] = high_[from];
      sign_low[k] = negative_low_[from] ? -1.0 : 1.0;
    }
    Values x = 0.5 * (low + high);
    for (int iteration = 0; iteration < 60; ++iteration) {
      Values p = Values::Constant(c[degree]), derivative = Values::Zero();
      for (int i = degree - 1; i >= 0; --i) {
        derivative = derivative * x + p;
        p = p * x + c[i];
      }
      double largest_step = 0.0;
      const Values newton = x - p / derivative;
      for (int k = 0; k < kWidth; ++k) {
        (p[k] * sign_low[k] > 0.0 ? low : high)[k] = x[k];
        double next = newton[k];
        if (!(next >= low[k] && next <= high[k])) next = 0.5 * (low[k] + high[k]);
        if (p[k] == 0.0) next = x[k];
        largest_step = std::max(largest_step, std::abs(next - x[k]) / (1.0 + std::abs(x[k])));
        x[k] = next;
      }
      // Newton's steps square: after one this short, the next would be below rounding.
      if (largest_step < 1e-8) break;
    }
    for (int k = 0; k < kWidth; ++k) roots[k] = x[k];
  }

  double low_[kMaxDegree], high_[kMaxDegree];
  bool negative_low_[kMaxDegree];
  int count_ = 0;
};

int RootsOfQuadratic(double a, double b, double c, double* roots) {
  const double discriminant = b * b - 4.0 * a * c;
  if (discriminant < 0.0) return 0;
  const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
  if (q == 0.0) {
    roots[0] = roots[1] = 0.0;
    return 2;
  }
  roots[0] = q / a;
  roots[1] = c / q;
  if (roots[0] > roots[1]) std::swap(roots[0], roots[1]);
  return 2;
}

}  // namespace

int RealRoots(const double* coefficients, int degree, double* roots) {
  CAIRN_DCHECK(degree <= kMaxDegree);
  double largest = 0.0;
  for (int i = 0; i <= degree; ++i) {
    if (!std::isfinite(coefficients[i])) return 0;
    largest = std::max(largest, std::abs(coefficients[i]));
  }
  if (!(largest > 0.0)) return 0;
  while (degree > 0 && std::abs(coefficients[degree]) <= 1e-15 * largest) --degree;
  if (degree == 0) return 0;
  if (degree == 1) {
    roots[0] = -coefficients[0] / coefficients[1];
    return 1;
  }
  if (degree == 2) {
    return RootsOfQuadratic(coefficients[2], coefficients[1], coefficients[0], roots);
  }

  double c[kMaxDegree + 1];
  for (int i = 0; i <= degree; ++i) c[i] = coefficients[i] / coefficients[degree];
  // Fujiwara's bound on the size of the roots, 2 max |c|^(1 / i), rounded up to a power of two.
  int exponent = -1000;
  for (int i = 1; i <= degree; ++i) {
    if (c[degree - i] == 0.0) continue;
    int e;
    std::frexp(c[degree - i], &e);  // |c| < 2^e
    exponent = std::max(exponent, e > 0 ? (e + i - 1) / i : -(-e / i));
  }
  const double bound = std::ldexp(2.0, exponent);

  const SturmChain chain(c, degree);
  struct Interval {
    double low, high;
    int changes_low, changes_high;
    int depth;
  };
  constexpr int kParts = SturmChain::kWidth + 1;
  Interval stack[200 * kParts + kParts];
  int size = 0;
  // Splits an interval at kParts - 1 points; the lowest part goes on top of the stack, so that
  // roots come out in increasing order.
  auto push_parts = [&](const Interval& interval, const double* points, const int* changes) {
    for (int k = kParts - 1; k >= 0; --k) {
      const Interval part = {
          k == 0 ? interval.low : points[k - 1], k == kParts - 1 ? interval.high : points[k],
          k == 0 ? interval.changes_low : changes[k - 1],
          k == kParts - 1 ? interval.changes_high : changes[k], interval.depth + 1};
      if (part.changes_low > part.changes_high) stack[size++] = part;
    }
  };
  double points[SturmChain::kWidth] = {-bound, bound, 0.0, 0.0};
  int changes[SturmChain::kWidth];
  chain.SignChanges(points, changes);
  const Interval all = {-bound, bound, changes[0], changes[1], 0};
  if (all.changes_low <= all.changes_high) return 0;
  // Roots of well-scaled problems have sizes around one, whatever the bound.
  for (int k = 0; k < SturmChain::kWidth; ++k) {
    static constexpr double kFirst[SturmChain::kWidth] = {-1.7, -0.4, 0.4, 1.7};
    points[k] = bound > 2.0 ? kFirst[k] : bound * (2.0 * (k + 1) / kParts - 1.0);
  }
  chain.SignChanges(points, changes);
  push_parts(all, points, changes);
  Brackets brackets;
  // Where rounding spoils the chain its counts are no longer monotone, and intervals could breed.
  constexpr int kMaxSplits = 200;
  for (int num_splits = 0; size > 0 && brackets.count() < degree && num_splits < kMaxSplits;) {
    const Interval interval = stack[--size];
    if (interval.changes_low - interval.changes_high == 1) {
      const bool negative_low = std::signbit(Evaluate(c, degree, interval.low));
      if (negative_low != std::signbit(Evaluate(c, degree, interval.high))) {
        brackets.Add(interval.low, interval.high, negative_low);
        continue;
      }
    }
    const double width = interval.high - interval.low;
    if (interval.depth >= 25 || !(width > 1e-15 * (1.0 + std::abs(interval.low)))) {
      // Too close to be told apart: one root at their place.
      brackets.Add(interval.low, interval.low, false);
      continue;
    }
    for (int k = 0; k < SturmChain::kWidth; ++k) {
      points[k] = interval.low + width * (k + 1) / kParts;
    }
    chain.SignChanges(points, changes);
    push_parts(interval, points, changes);
    ++num_splits;
  }
  brackets.Refine(c, degree, roots);
  return brackets.count();
}

}  // namespace cairn
