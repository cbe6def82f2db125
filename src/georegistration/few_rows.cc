#include "georegistration/few_rows.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>
#include <unsupported/Eigen/SpecialFunctions>

#include "cairn/evaluation/alignment.h"
#include "math/log_binomial.h"

namespace cairn {
namespace {

constexpr double kChance = 0.01;
constexpr double kFarOutSigmas = 30;
constexpr int kSimilarity = 7;  // its degrees of freedom

bool IsIn(uint32_t rows, int i) { return (rows >> i & 1) != 0; }

// A set of wrong rows, as bits, and the squares that the others leave.
struct WrongSet {
  uint32_t rows = 0;
  double squares = 0;

  int Size() const { return std::popcount(rows); }
};

class FewRows {
 public:
  FewRows(const std::vector<Eigen::Vector3d>& src, const std::vector<Eigen::Vector3d>& dst,
          double min_sigma)
      : src_(src),
        dst_(dst),
        n_(static_cast<int>(src.size())),
        min_variance_(min_sigma * min_sigma) {}

  WrongSet FindWrong() const {
    WrongSet wrong{0, SquaresWithout(0).value_or(0)};
    for (int m = 1; Freedom(m) > 0 && 2 * m < n_; ++m) {
      const std::optional<WrongSet> best = BestOfSize(m);
      if (best && IsBeyondChance(wrong, *best) && IsFarOut(*best)) wrong = *best;
    }
    return wrong;
  }

 private:
  int Freedom(int num_wrong) const { return 3 * (n_ - num_wrong) - kSimilarity; }

  std::optional<Sim3d> FitWithout(uint32_t wrong) const {
    std::vector<Eigen::Vector3d> src, dst;
    for (int i = 0; i < n_; ++i) {
      if (IsIn(wrong, i)) continue;
      src.push_back(src_[i]);
      dst.push_back(dst_[i]);
    }
    return AlignSimilarity(src, dst);
  }

  double Square(const Sim3d& fit, int i) const { return (fit * src_[i] - dst_[i]).squaredNorm(); }

  std::optional<double> SquaresWithout(uint32_t wrong) const {
    const std::optional<Sim3d> fit = FitWithout(wrong);
    if (!fit) return std::nullopt;
    double squares = 0;
    for (int i = 0; i < n_; ++i) squares += IsIn(wrong, i) ? 0 : Square(*fit, i);
    return squares;
  }

  std::optional<WrongSet> BestOfSize(int m) const {
    std::optional<WrongSet> best;
    for (uint32_t rows = 0; rows < uint32_t{1} << n_; ++rows) {
      if (std::popcount(rows) != m) continue;
      const std::optional<double> squares = SquaresWithout(rows);
      if (squares && (!best || *squares < best->squares)) best = {rows, *squares};
    }
    return best;
  }

  bool IsBeyondChance(const WrongSet& before, const WrongSet& after) const {
    const double freedom1 = 3.0 * (after.Size() - before.Size()), freedom2 = Freedom(after.Size());
    const double f = (before.squares - after.squares) / freedom1 / Variance(after);
    const double num_sets = std::exp(LogBinomial(n_, after.Size()));
    return f > 0 && num_sets * TailOfF(f, freedom1, freedom2) < kChance;
  }

  // The standard deviation along an axis of the rows that are not wrong, squared.
  double Variance(const WrongSet& wrong) const {
    return std::max(wrong.squares / Freedom(wrong.Size()), min_variance_);
  }

  bool IsFarOut(const WrongSet& wrong) const {
    const std::optional<Sim3d> fit = FitWithout(wrong.rows);
    for (int i = 0; i < n_; ++i) {
      if (!IsIn(wrong.rows, i)) continue;
      if (!(Square(*fit, i) > kFarOutSigmas * kFarOutSigmas * Variance(wrong))) return false;
    }
    return true;
  }

  const std::vector<Eigen::Vector3d>& src_;
  const std::vector<Eigen::Vector3d>& dst_;
  const int n_;
  const double min_variance_;
};

}  // namespace

double TailOfF(double f, double freedom1, double freedom2) {
  using Value = Eigen::Array<double, 1, 1>;
  const Value a(freedom2 / 2), b(freedom1 / 2), x(freedom2 / (freedom2 + freedom1 * f));
  return Eigen::betainc(a, b, x)(0);
}

std::vector<bool> FindWrongRows(const std::vector<Eigen::Vector3d>& src,
                                const std::vector<Eigen::Vector3d>& dst, double min_sigma) {
  const WrongSet wrong = FewRows(src, dst, min_sigma).FindWrong();
  std::vector<bool> is_wrong;
  for (size_t i = 0; i < src.size(); ++i) {
    is_wrong.push_back(IsIn(wrong.rows, static_cast<int>(i)));
  }
  return is_wrong;
}

}  // namespace cairn
