#include "cairn/solvers/polynomial.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "cairn/base/check.h"

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solvers/polynomial.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd4d-inl.h"

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

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
  void SignChanges(const double* points, int* changes) const {
    static_assert(kWidth == kParts * kLanes);
    const hn::RebindToUnsigned<Tag> bits;
    V x[kParts], next[kParts], value[kParts];
    hn::Vec<decltype(bits)> counts[kParts];
    for (int k = 0; k < kParts; ++k) {
      x[k] = Load(points + k * kLanes);
      next[k] = Const(0.0);
      value[k] = Const(common_degree_ > 0 ? common_[common_degree_] : last_);
      counts[k] = hn::Zero(bits);
    }
    for (int i = common_degree_ - 1; i >= 0; --i) {
      for (int k = 0; k < kParts; ++k) value[k] = value[k] * x[k] + Const(common_[i]);
    }
    for (int i = length_ - 1; i >= 0; --i) {
      const V slope = Const(slope_[i]), offset = Const(offset_[i]);
      for (int k = 0; k < kParts; ++k) {
        const V previous = (slope * x[k] + offset) * value[k] - next[k];
        counts[k] = counts[k] + hn::ShiftRight<63>(hn::BitCast(bits, hn::Xor(previous, value[k])));
        next[k] = value[k];
        value[k] = previous;
      }
    }
    HWY_ALIGN uint64_t stored[kWidth];
    for (int k = 0; k < kParts; ++k) hn::Store(counts[k], bits, stored + k * kLanes);
    for (int k = 0; k < kWidth; ++k) changes[k] = static_cast<int>(stored[k]);
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
  static constexpr int kWidth = 8;

  void RefineGroup(const double* c, int degree, int first, double* roots) const {
    constexpr int kNumVectors = kWidth / kLanes;
    V low[kNumVectors], high[kNumVectors], sign_low[kNumVectors], x[kNumVectors];
    for (int part = 0; part < kNumVectors; ++part) {
      double lows[kLanes], highs[kLanes], signs[kLanes];
      for (int lane = 0; lane < kLanes; ++lane) {
        // A short group repeats its last one.
        const int k = std::min(first + part * kLanes + lane, count_ - 1);
        lows[lane] = low_[k];
        highs[lane] = high_[k];
        signs[lane] = negative_low_[k] ? -1.0 : 1.0;
      }
      low[part] = Load(lows);
      high[part] = Load(highs);
      sign_low[part] = Load(signs);
      x[part] = Const(0.5) * (low[part] + high[part]);
    }
    for (int iteration = 0; iteration < 60; ++iteration) {
      V p[kNumVectors], derivative[kNumVectors];
      for (int k = 0; k < kNumVectors; ++k) {
        p[k] = Const(c[degree]);
        derivative[k] = Const(0.0);
      }
      for (int i = degree - 1; i >= 0; --i) {
        for (int k = 0; k < kNumVectors; ++k) {
          derivative[k] = derivative[k] * x[k] + p[k];
          p[k] = p[k] * x[k] + Const(c[i]);
        }
      }
      V largest_step = Const(0.0);
      for (int k = 0; k < kNumVectors; ++k) {
        const auto is_low = p[k] * sign_low[k] > Const(0.0);
        low[k] = hn::IfThenElse(is_low, x[k], low[k]);
        high[k] = hn::IfThenElse(is_low, high[k], x[k]);
        const V newton = x[k] - p[k] / derivative[k];
        const auto is_inside = hn::And(newton >= low[k], newton <= high[k]);
        V next = hn::IfThenElse(is_inside, newton, Const(0.5) * (low[k] + high[k]));
        next = hn::IfThenElse(p[k] == Const(0.0), x[k], next);
        const V step = hn::Abs(next - x[k]) / (Const(1.0) + hn::Abs(x[k]));
        largest_step = hn::Max(largest_step, step);
        x[k] = next;
      }
      // Newton's steps square: after one this short, the next would be below rounding.
      if (hn::AllTrue(kTag, largest_step < Const(1e-8))) break;
    }
    for (int k = 0; k < kNumVectors; ++k) Store(x[k], roots + k * kLanes);
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

// Of a monic polynomial: Fujiwara's bound on the size of its roots, 2 max |c|^(1 / i), rounded up
// to a power of two.
HWY_INLINE double RootBound(const double* c, int degree) {
  int exponent = -1000;
  for (int i = 1; i <= degree; ++i) {
    if (c[degree - i] == 0.0) continue;
    int e;
    std::frexp(c[degree - i], &e);  // |c| < 2^e
    exponent = std::max(exponent, e > 0 ? (e + i - 1) / i : -(-e / i));
  }
  return std::ldexp(2.0, exponent);
}

// An interval that has roots, with the chain's sign changes at its ends.
struct Interval {
  double low, high;
  int changes_low, changes_high;
  int depth;
};

// The lowest interval is on top, so that roots come out in increasing order.
class IntervalStack {
 public:
  static constexpr int kParts = SturmChain::kWidth + 1;
  static constexpr int kMaxSplits = 200;

  // The parts of an interval that is split at kParts - 1 points.
  void PushParts(const Interval& interval, const double* points, const int* changes) {
    for (int k = kParts - 1; k >= 0; --k) {
      const Interval part = {
          k == 0 ? interval.low : points[k - 1], k == kParts - 1 ? interval.high : points[k],
          k == 0 ? interval.changes_low : changes[k - 1],
          k == kParts - 1 ? interval.changes_high : changes[k], interval.depth + 1};
      if (part.changes_low > part.changes_high) stack_[size_++] = part;
    }
  }
  Interval Pop() { return stack_[--size_]; }
  int size() const { return size_; }

 private:
  Interval stack_[kMaxSplits * kParts + kParts];
  int size_ = 0;
};

// Brackets of the roots of a monic polynomial, in increasing order.
HWY_INLINE Brackets IsolateRoots(const double* c, int degree) {
  Brackets brackets;
  const double bound = RootBound(c, degree);
  const SturmChain chain(c, degree);
  double points[SturmChain::kWidth] = {-bound, bound, 0.0, 0.0};
  int changes[SturmChain::kWidth];
  chain.SignChanges(points, changes);
  const Interval all = {-bound, bound, changes[0], changes[1], 0};
  if (all.changes_low <= all.changes_high) return brackets;
  // Roots of well-scaled problems have sizes around one, whatever the bound.
  for (int k = 0; k < SturmChain::kWidth; ++k) {
    static constexpr double kFirst[SturmChain::kWidth] = {-1.7, -0.4, 0.4, 1.7};
    points[k] = bound > 2.0 ? kFirst[k] : bound * (2.0 * (k + 1) / IntervalStack::kParts - 1.0);
  }
  chain.SignChanges(points, changes);
  IntervalStack stack;
  stack.PushParts(all, points, changes);
  // Where rounding spoils the chain its counts are no longer monotone, and intervals could breed.
  for (int num_splits = 0;
       stack.size() > 0 && brackets.count() < degree && num_splits < IntervalStack::kMaxSplits;) {
    const Interval interval = stack.Pop();
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
      points[k] = interval.low + width * (k + 1) / IntervalStack::kParts;
    }
    chain.SignChanges(points, changes);
    stack.PushParts(interval, points, changes);
    ++num_splits;
  }
  return brackets;
}

int RealRootsKernel(const double* coefficients, int degree, double* roots) {
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
  Brackets brackets = IsolateRoots(c, degree);
  brackets.Refine(c, degree, roots);
  return brackets.count();
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {

HWY_EXPORT(RealRootsKernel);

int RealRoots(const double* coefficients, int degree, double* roots) {
  CAIRN_DCHECK(degree <= 10);
  return HWY_DYNAMIC_DISPATCH(RealRootsKernel)(coefficients, degree, roots);
}

}  // namespace cairn
#endif
