#include "cairn/solvers/polynomial.h"

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

  // Number of sign changes of the chain at x.
  int SignChanges(double x) const {
    double next = 0.0;
    double value = last_;
    if (common_degree_ > 0) {
      value = common_[common_degree_];
      for (int i = common_degree_ - 1; i >= 0; --i) value = value * x + common_[i];
    }
    int changes = 0;
    for (int i = length_ - 1; i >= 0; --i) {
      const double previous = (slope_[i] * x + offset_[i]) * value - next;
      changes += std::signbit(previous) != std::signbit(value);
      next = value;
      value = previous;
    }
    return changes;
  }

 private:
  double slope_[kMaxDegree], offset_[kMaxDegree];
  double common_[kMaxDegree + 1];
  double last_ = 0.0;
  int length_ = 0;
  int common_degree_ = 0;
};

struct Value {
  double p;
  double derivative;
};

Value Evaluate(const double* c, int degree, double x) {
  Value v{c[degree], 0.0};
  for (int i = degree - 1; i >= 0; --i) {
    v.derivative = v.derivative * x + v.p;
    v.p = v.p * x + c[i];
  }
  return v;
}

// The root in [low, high], which holds exactly one: Newton's method, bisection where it leaves the
// bracket or stalls.
double RefineRoot(const double* c, int degree, double low, double high) {
  const bool negative_low = std::signbit(Evaluate(c, degree, low).p);
  double x = 0.5 * (low + high);
  for (int i = 0; i < 60; ++i) {
    const Value v = Evaluate(c, degree, x);
    if (v.p == 0.0) return x;
    (std::signbit(v.p) == negative_low ? low : high) = x;
    double next = x - v.p / v.derivative;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const double step = std::abs(next - x);
    x = next;
    if (step <= 1e-15 * (1.0 + std::abs(x))) break;
  }
  return x;
}

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
  for (int i = 0; i <= degree; ++i) largest = std::max(largest, std::abs(coefficients[i]));
  if (!(largest > 0.0) || !std::isfinite(largest)) return 0;
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
  // Fujiwara's bound on the size of the roots.
  double bound = 0.0;
  for (int i = 1; i <= degree; ++i) {
    const double a = std::abs(c[degree - i]);
    if (a > 0.0) bound = std::max(bound, std::pow(a, 1.0 / i));
  }
  bound = 2.0 * bound * (1.0 + 1e-12) + 1e-300;

  const SturmChain chain(c, degree);
  struct Interval {
    double low, high;
    int changes_low, changes_high;
    int depth;
  };
  Interval stack[64];
  int size = 0;
  stack[size++] = {-bound, bound, chain.SignChanges(-bound), chain.SignChanges(bound), 0};
  int count = 0;
  while (size > 0 && count < degree) {
    const Interval interval = stack[--size];
    const int inside = interval.changes_low - interval.changes_high;
    if (inside <= 0) continue;
    if (inside == 1) {
      const double at_low = Evaluate(c, degree, interval.low).p;
      const double at_high = Evaluate(c, degree, interval.high).p;
      if (std::signbit(at_low) != std::signbit(at_high)) {
        roots[count++] = RefineRoot(c, degree, interval.low, interval.high);
        continue;
      }
    }
    const double middle = 0.5 * (interval.low + interval.high);
    if (interval.depth >= 55 || !(middle > interval.low && middle < interval.high)) {
      roots[count++] = middle;  // Several roots closer than can be told apart.
      continue;
    }
    const int changes = chain.SignChanges(middle);
    // The lower half goes on top, so that roots come out in increasing order.
    stack[size++] = {middle, interval.high, changes, interval.changes_high, interval.depth + 1};
    stack[size++] = {interval.low, middle, interval.changes_low, changes, interval.depth + 1};
  }
  return count;
}

}  // namespace cairn
