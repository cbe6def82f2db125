#include "features/extrema.h"

#include <Eigen/LU>
#include <cmath>

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "features/extrema.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd16-inl.h"

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

void SubtractKernel(const float* a, const float* b, int stride, float* difference) {
  for (int x = 0; x < stride; x += kLanes) {
    hn::StoreU(LoadU(a + x) - LoadU(b + x), kTag, difference + x);
  }
}

// Which pixels of rows[4], the middle of nine rows (three of the level below, three of its own,
// three of the level above), exceed the threshold and all 26 neighbors, in either direction.
void FindInRowKernel(const float* const* rows, int width, float threshold,
                     std::vector<int>& found) {
  constexpr int kOrder[] = {4, 1, 7, 3, 5, 0, 2, 6, 8};  // the nearest rows exclude most
  const V least = Const(threshold);
  for (int x = 1; x < width - 1; x += kLanes) {
    const V center = LoadU(rows[4] + x);
    auto is_max = center > least;
    auto is_min = hn::Neg(center) > least;
    for (const int r : kOrder) {
      if (hn::AllFalse(kTag, hn::Or(is_max, is_min))) break;
      for (int shift = -1; shift <= 1; ++shift) {
        if (r == 4 && shift == 0) continue;
        const V other = LoadU(rows[r] + x + shift);
        is_max = hn::And(is_max, center > other);
        is_min = hn::And(is_min, center < other);
      }
    }
    const auto is_extremum = hn::Or(is_max, is_min);
    if (hn::AllFalse(kTag, is_extremum)) continue;
    HWY_ALIGN float lanes[16];
    hn::Store(hn::IfThenElseZero(is_extremum, Const(1.0f)), kTag, lanes);
    for (int k = 0; k < kLanes && x + k < width - 1; ++k) {
      if (lanes[k] != 0) found.push_back(x + k);
    }
  }
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {
HWY_EXPORT(SubtractKernel);
HWY_EXPORT(FindInRowKernel);
namespace {

constexpr int kNumDifferences = Octave::kLevels + 2;
constexpr double kMinShare = 0.8;  // of the threshold, before the extremum is refined
constexpr double kMaxOffset = 0.6;
constexpr int kMaxMoves = 5;

// Three rows of every difference of two levels: those around the row that is searched.
class DifferenceRows {
 public:
  explicit DifferenceRows(const Octave& octave)
      : octave_(octave),
        stride_(octave.levels[0].stride),
        data_(kNumDifferences * 3 * stride_ + 32) {}

  void Compute(int y) {
    for (int level = 0; level < kNumDifferences; ++level) {
      HWY_DYNAMIC_DISPATCH(SubtractKernel)
      (octave_.levels[level + 1].Row(y), octave_.levels[level].Row(y), stride_, Row(level, y));
    }
  }
  float* Row(int level, int y) { return &data_[static_cast<size_t>(level * 3 + y % 3) * stride_]; }

 private:
  const Octave& octave_;
  const int stride_;
  std::vector<float> data_;
};

// The difference of Gaussians around a pixel of a level.
struct Neighborhood {
  double At(int dx, int dy, int dlevel) const {
    const auto& levels = octave.levels;
    return static_cast<double>(levels[level + dlevel + 1].Row(y + dy)[x + dx]) -
           levels[level + dlevel].Row(y + dy)[x + dx];
  }
  Eigen::Vector3d Gradient() const {
    return 0.5 * Eigen::Vector3d(At(1, 0, 0) - At(-1, 0, 0), At(0, 1, 0) - At(0, -1, 0),
                                 At(0, 0, 1) - At(0, 0, -1));
  }
  Eigen::Matrix3d Hessian() const {
    const double twice = 2 * At(0, 0, 0);
    const double xy = 0.25 * (At(1, 1, 0) - At(-1, 1, 0) - At(1, -1, 0) + At(-1, -1, 0));
    const double xl = 0.25 * (At(1, 0, 1) - At(-1, 0, 1) - At(1, 0, -1) + At(-1, 0, -1));
    const double yl = 0.25 * (At(0, 1, 1) - At(0, -1, 1) - At(0, 1, -1) + At(0, -1, -1));
    const double xx = At(1, 0, 0) + At(-1, 0, 0) - twice;
    const double yy = At(0, 1, 0) + At(0, -1, 0) - twice;
    const double ll = At(0, 0, 1) + At(0, 0, -1) - twice;
    return (Eigen::Matrix3d() << xx, xy, xl, xy, yy, yl, xl, yl, ll).finished();
  }

  const Octave& octave;
  int x, y, level;
};

bool IsEdge(const Eigen::Matrix3d& hessian, double max_ratio) {
  const double trace = hessian(0, 0) + hessian(1, 1);
  const double determinant = hessian.topLeftCorner<2, 2>().determinant();
  return trace * trace * max_ratio >= (max_ratio + 1) * (max_ratio + 1) * determinant;
}

// Moves to the extremum of the quadric through the neighborhood (Lowe, equations 2 and 3).
bool Refine(Neighborhood at, const FeatureOptions& options, Extremum* extremum) {
  const Plane& plane = at.octave.levels[0];
  for (int move = 0; move < kMaxMoves; ++move) {
    const Eigen::Vector3d gradient = at.Gradient();
    const Eigen::Matrix3d hessian = at.Hessian();
    const Eigen::Vector3d offset = -hessian.fullPivLu().solve(gradient);
    if (offset.cwiseAbs().maxCoeff() <= kMaxOffset) {
      *extremum = {at.x + offset[0], at.y + offset[1], at.level + offset[2],
                   at.At(0, 0, 0) + 0.5 * gradient.dot(offset)};
      return std::abs(extremum->value) >= options.peak_threshold &&
             !IsEdge(hessian, options.edge_threshold);
    }
    auto step = [](double o) { return o > kMaxOffset ? 1 : o < -kMaxOffset ? -1 : 0; };
    at.x += step(offset[0]);
    at.y += step(offset[1]);
    at.level += step(offset[2]);
    if (at.x < 1 || at.x > plane.width - 2 || at.y < 1 || at.y > plane.height - 2) return false;
    if (at.level < 1 || at.level > Octave::kLevels) return false;
  }
  return false;
}

}  // namespace

bool Extremum::Reaches(double peak_threshold) const {
  return std::abs(pixel_value) > static_cast<float>(kMinShare * peak_threshold) &&
         std::abs(value) >= peak_threshold;
}

std::vector<Extremum> FindExtrema(const Octave& octave, const FeatureOptions& options) {
  std::vector<Extremum> extrema;
  const Plane& plane = octave.levels[0];
  const auto threshold = static_cast<float>(kMinShare * options.peak_threshold);
  DifferenceRows differences(octave);
  std::vector<int> found;
  for (int y = 0; y < std::min(2, plane.height); ++y) differences.Compute(y);
  for (int y = 1; y < plane.height - 1; ++y) {
    differences.Compute(y + 1);
    for (int level = 1; level <= Octave::kLevels; ++level) {
      const float* rows[9];
      for (int r = 0; r < 9; ++r) rows[r] = differences.Row(level - 1 + r / 3, y - 1 + r % 3);
      found.clear();
      HWY_DYNAMIC_DISPATCH(FindInRowKernel)(rows, plane.width, threshold, found);
      for (const int x : found) {
        Extremum extremum;
        if (!Refine({octave, x, y, level}, options, &extremum)) continue;
        extremum.pixel_value = rows[4][x];
        extrema.push_back(extremum);
      }
    }
  }
  return extrema;
}

}  // namespace cairn
#endif
