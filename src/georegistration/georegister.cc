#include "cairn/georegistration/georegister.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <utility>

#include "cairn/evaluation/alignment.h"
#include "cairn/evaluation/error_statistics.h"
#include "cairn/math/angles.h"
#include "cairn/math/decompositions.h"
#include "georegistration/few_rows.h"
#include "georegistration/known_rows.h"
#include "georegistration/open_heights.h"
#include "math/log_binomial.h"

namespace cairn {
namespace {

// The median length of three normal coordinates, and of two, in standard deviations of one of them.
constexpr double kMedianLength = 1.5382, kMedianLength2D = 1.1774;
// What shows that a model is tilted is chance in so many cases where it is level; that some rows
// are wrong, where all are right.
constexpr double kMaxChance = 0.01;
// Tukey's fence for what is far out (Exploratory Data Analysis, 1977): so many quartile distances
// beyond the upper quartile. Of three normal coordinates it lies at 4.80 standard deviations, which
// 1 in 25,000 exceed; tails that are longer, as those of a model that bends, move it outwards.
constexpr double kFarOut = 3.0;
constexpr double kNormalFence = 4.80;
// The first guess at what agrees: residuals up to so many medians, 4.6 standard deviations.
constexpr double kFirstMedians = 3.0;
// No receiver is better than this.
constexpr double kMinSigmaM = kControlPointSigmaM;
// Of so many rows the quartiles tell enough to find normal ones wrong as seldom as the fence says.
constexpr size_t kManyRows = 50;
constexpr int kMaxRounds = 50;
// Cameras whose path is this much longer than wide are on a line but for rounding.
constexpr double kMinWidth = 1e-6;

// Those that are not wrong.
Rows Kept(const Rows& rows) {
  Rows kept;
  std::ranges::copy_if(rows, std::back_inserter(kept), std::logical_not(), &Row::is_wrong);
  return kept;
}

// A value of each row: of a field, or what a function gives.
template <class Get>
auto Column(const Rows& rows, const Get& get) {
  std::vector<std::decay_t<std::invoke_result_t<Get, const Row&>>> column;
  for (const Row& row : rows) column.push_back(std::invoke(get, row));
  return column;
}

void Measure(const Sim3d& enu_from_world, Rows& rows) {
  for (Row& row : rows) {
    row.residual = enu_from_world * row.in_model - row.enu;
    if (!row.has_height) row.residual.z() = 0;
  }
}

double ResidualM(const Row& row) { return row.residual.norm(); }
double RelativeResidual(const Row& row) { return row.residual.norm() / row.sigma_m; }

// Beyond which a relative residual is far out, by those of the rows that are not wrong.
double Fence(const Rows& rows) {
  std::vector<double> kept = Column(Kept(rows), RelativeResidual);
  std::sort(kept.begin(), kept.end());
  const double lower = kept[kept.size() / 4], upper = kept[(3 * kept.size()) / 4];
  return upper + kFarOut * (upper - lower);
}

// Says which rows are wrong, by residuals over a limit; whether any answer changed.
template <class LimitM>
bool Judge(const LimitM& limit_m, Rows& rows) {
  bool has_changed = false;
  for (Row& row : rows) {
    const double least_m = kNormalFence * std::max(row.given_sigma_m, kMinSigmaM);
    const bool is_wrong = ResidualM(row) > std::max(limit_m(row), least_m);
    has_changed |= std::exchange(row.is_wrong, is_wrong) != is_wrong;
  }
  return has_changed;
}

double Weight(const Row& row) { return 1.0 / (row.sigma_m * row.sigma_m); }

// Least squares over the rows that are not wrong.
std::optional<Sim3d> Fit(const Rows& rows) {
  const Rows kept = Kept(rows);
  return AlignSimilarity(Column(kept, &Row::in_model), Column(kept, &Row::enu),
                         Column(kept, Weight));
}

// The same for rows without heights, from a start on.
Sim3d FitHorizontally(const Rows& rows, const Sim3d& start) {
  const Rows kept = Kept(rows);
  return AlignHorizontally(Column(kept, &Row::in_model), Column(kept, &Row::enu),
                           Column(kept, Weight), start);
}

// What the first guess, which does not know sigmas, finds wrong: precise rows are not wrong because
// it is off.
void JudgeFirst(const Sim3d& start, Rows& rows) {
  Measure(start, rows);
  const double median_m = Median(Column(rows, ResidualM));
  Judge([&](const Row&) { return kFirstMedians * median_m; }, rows);
}

// Standard deviations of the points along their principal axes, the smallest first.
Eigen::Vector3d Extents(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point / static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points) {
    covariance += (point - mean) * (point - mean).transpose() / static_cast<double>(points.size());
  }
  return SymmetricEigen(covariance).values.cwiseMax(0).cwiseSqrt();
}

double MedianLength(const Rows& rows) {
  return rows.front().has_height ? kMedianLength : kMedianLength2D;
}

// Fills the figures of the final fit, and its status.
void Assess(const Rows& rows, Georegistration& out) {
  const Rows kept = Kept(rows);
  out.median_residual_m = Median(Column(kept, ResidualM));
  const Eigen::Vector3d extents =
      Extents(Column(kept, [&](const Row& row) { return out.enu_from_world * row.in_model; }));
  if (!(extents[1] > kMinWidth * extents[2])) {
    out.status = GeoregistrationStatus::kOnALine;
    return;
  }
  const double sigma_m = out.median_residual_m / MedianLength(kept);
  out.roll_sigma_deg = RadToDeg(std::atan(sigma_m / (std::hypot(extents[0], extents[1]) *
                                                     std::sqrt(static_cast<double>(kept.size())))));
  // A similarity that shrinks the model to a point explains nothing, and leaves the distances.
  Eigen::Vector3d middle;
  for (int k = 0; k < 3; ++k) {
    middle[k] = Median(Column(kept, [k](const Row& row) { return row.enu[k]; }));
  }
  const double median_distance_m =
      Median(Column(kept, [&](const Row& row) { return (row.enu - middle).norm(); }));
  out.status = out.median_residual_m > 0.5 * median_distance_m ? GeoregistrationStatus::kNoAgreement
                                                               : GeoregistrationStatus::kOk;
}

// Three rows agree, whatever they say. Where of the others no more than half do, a model that bends
// may leave as much, unless the wrong ones are so far off that these are hardly ever so near: over
// all choices of the three, for errors as large as that of the middle wrong row (a contrario).
bool IsByChance(const Rows& rows) {
  const Rows kept = Kept(rows);
  const auto n = static_cast<int>(rows.size()), num_kept = static_cast<int>(kept.size());
  if (2 * (num_kept - 3) > n - 3) return false;
  if (2 * num_kept <= n || num_kept == n) return true;
  Rows wrong;
  std::ranges::copy_if(rows, std::back_inserter(wrong), &Row::is_wrong);
  const double ratio =
      std::ranges::max(Column(kept, RelativeResidual)) / Median(Column(wrong, RelativeResidual));
  const int num_axes = rows.front().has_height ? 3 : 2;
  const double log_chance = LogBinomial(n, 3) + LogBinomial(n - 3, num_kept - 3) +
                            num_axes * (num_kept - 3) * std::log(std::max(ratio, 1e-12));
  return log_chance > std::log(kMaxChance);
}

// Do the rows agree better without those that are wrong than chance explains? The F test over all
// sets of as many. Of few rows quartiles tell little, and a fit follows those that are kept.
bool AreWrong(const Rows& rows, const Rows& all) {
  if (rows.size() >= kManyRows) return true;
  const double num_axes = rows.front().has_height ? 3 : 2;
  const auto num_wrong = static_cast<double>(std::ranges::count_if(rows, &Row::is_wrong));
  const auto n = static_cast<double>(rows.size());
  const double freedom1 = num_axes * num_wrong;
  const double freedom2 = num_axes * (n - num_wrong) - (rows.front().has_height ? 7 : 6);
  if (!(freedom1 > 0 && freedom2 > 0)) return false;
  const auto sum_of_squares = [](const Rows& some) {
    double sum = 0;
    for (const Row& row : some) sum += Weight(row) * row.residual.squaredNorm();
    return sum;
  };
  const double without = sum_of_squares(Kept(rows));
  const double f = (sum_of_squares(all) - without) / freedom1 / (without / freedom2);
  if (!(f > 0)) return false;
  return LogBinomial(static_cast<int>(n), static_cast<int>(num_wrong)) +
             std::log(TailOfF(f, freedom1, freedom2)) <
         std::log(kMaxChance);
}

// The similarity by a few control points; false: there is none.
bool AlignFew(Rows& rows, Georegistration& out) {
  const std::vector<bool> is_wrong =
      FindWrongRows(Column(rows, &Row::in_model), Column(rows, &Row::enu), kMinSigmaM);
  for (size_t i = 0; i < rows.size(); ++i) rows[i].is_wrong = is_wrong[i];
  const std::optional<Sim3d> fit = Fit(rows);
  if (!fit) return false;
  out.enu_from_world = *fit;
  Measure(*fit, rows);
  return true;
}

// From a first guess on: fit(rows, last) over the rows that agree, until these stay the same.
template <class FitRows>
Sim3d AlignFrom(const Sim3d& start, const FitRows& fit, Rows& rows) {
  JudgeFirst(start, rows);
  Sim3d found = start;
  for (int round = 0; round < kMaxRounds; ++round) {
    const std::optional<Sim3d> next = fit(rows, found);
    if (!next) break;
    found = *next;
    Measure(found, rows);
    const double fence = Fence(rows);
    if (!Judge([&](const Row& row) { return fence * row.sigma_m; }, rows)) break;
  }
  if (rows.size() > 3 && std::ranges::none_of(rows, &Row::is_wrong)) return found;
  Rows all = rows;
  for (Row& row : all) row.is_wrong = false;
  const Sim3d by_all = fit(all, found).value_or(found);
  Measure(by_all, all);
  if (!IsByChance(rows) && AreWrong(rows, all)) return found;
  rows = std::move(all);
  return by_all;
}

// The similarity by any number of rows. Where they have no height, all are at the same one.
bool AlignMany(uint64_t seed, Rows& rows, Georegistration& out) {
  const std::optional<Sim3d> start =
      AlignSimilarityRobust(Column(rows, &Row::in_model), Column(rows, &Row::enu), seed);
  if (!start) return false;
  out.enu_from_world = AlignFrom(
      *start, [](const Rows& some, const Sim3d&) { return Fit(some); }, rows);
  return true;
}

// Of the rows that are not wrong: squared horizontal residuals, each with the error that the best
// receivers have.
double SumOfSquares(const Sim3d& enu_from_world, const Rows& rows) {
  Rows kept = Kept(rows);
  Measure(enu_from_world, kept);
  double sum = 0;
  for (const Row& row : kept) {
    sum += Weight(row) * (row.residual.head<2>().squaredNorm() + 2 * kMinSigmaM * kMinSigmaM);
  }
  return sum;
}

// Does a similarity agree better with the rows than one of another tilt, by more than chance? The F
// test with 2 and 2 n - 6 degrees of freedom, whose tail is a power.
bool IsBetter(const Sim3d& tilted, const Sim3d& other, const Rows& rows) {
  const auto num_spare = static_cast<double>(std::ssize(Kept(rows)) - 3);
  return std::pow(SumOfSquares(tilted, rows) / SumOfSquares(other, rows), num_spare) < kMaxChance;
}

// The same cameras seen from above, tilted the other way.
std::optional<Sim3d> TiltedTheOtherWay(const Sim3d& enu_from_world, const Rows& rows) {
  const std::vector<Eigen::Vector3d> in_model = Column(Kept(rows), &Row::in_model);
  std::vector<Eigen::Vector3d> mirrored;
  for (const Eigen::Vector3d& x : in_model) {
    mirrored.push_back((enu_from_world * x).cwiseProduct(Eigen::Vector3d(1, 1, -1)));
  }
  return AlignSimilarity(in_model, mirrored);
}

// The similarity by rows without heights, tilted as their places show; false: they show nothing.
bool AlignTilted(const Reconstruction& model, uint64_t seed, Rows& rows, Georegistration& out) {
  const std::optional<Sim3d> start =
      AlignHorizontallyRobust(Column(rows, &Row::in_model), Column(rows, &Row::enu), seed);
  if (!start) return false;
  Rows tilted = rows;
  const Sim3d found = AlignFrom(
      *start,
      [](const Rows& some, const Sim3d& last) {
        return std::optional(FitHorizontally(some, last));
      },
      tilted);
  const std::optional<Sim3d> flat = Fit(tilted), other = TiltedTheOtherWay(found, tilted);
  if (!flat || !other || !IsBetter(found, *flat, tilted)) return false;
  rows = std::move(tilted);
  const bool is_sure = IsBetter(found, *other, rows);
  out.tilt_source = is_sure ? TiltSource::kPositions : TiltSource::kPhotographs;
  const bool is_other =
      !is_sure && OffLevel(model, other->rotation) < OffLevel(model, found.rotation);
  out.enu_from_world = is_other ? *other : found;
  Measure(out.enu_from_world, rows);
  return true;
}

// The similarity by rows; false: there is none.
bool Align(const Reconstruction& model, uint64_t seed, Rows& rows, Georegistration& out) {
  if (out.by_control_points && rows.size() <= kFewRows) return AlignFew(rows, out);
  if (rows.front().has_height) return AlignMany(seed, rows, out);
  if (AlignTilted(model, seed, rows, out)) return true;
  out.tilt_source = TiltSource::kNothing;
  return AlignMany(seed, rows, out);
}

// Residuals of the images, and how good their positions are.
void FinishImages(Rows rows, Georegistration& out) {
  Measure(out.enu_from_world, rows);
  const double factor = Median(Column(Kept(rows), RelativeResidual)) / MedianLength(rows);
  for (size_t i = 0; i < rows.size(); ++i) {
    GeoregisteredImage& image = out.images[i];
    image.residual = rows[i].residual;
    image.is_wrong = rows[i].is_wrong;
    const double scale = image.is_sigma_given ? std::max(1.0, factor) : factor;
    image.sigma_m = std::max(image.sigma_m * scale, kMinSigmaM);
  }
}

// Residuals of the control points. Where heights are open, that of the model is taken.
void FinishPoints(const Reconstruction& model, Rows rows, Georegistration& out) {
  for (Row& row : rows) row.has_height = out.tilt_source == TiltSource::kAltitudes;
  Measure(out.enu_from_world, rows);
  const Sim3d world_from_enu = Inverse(out.enu_from_world);
  for (size_t i = 0; i < rows.size(); ++i) {
    GeoregisteredPoint& point = out.points[i];
    point.residual = rows[i].residual;
    Eigen::Vector3d enu = point.enu;
    if (!rows[i].has_height) enu.z() = (out.enu_from_world * rows[i].in_model).z();
    for (const auto& [id, pixel] : point.pixels) {
      const RegisteredImage& image = model.images.at(id);
      point.error_px += ReprojectionErrorPx(model.CameraOf(image), image.cam_from_world,
                                            world_from_enu * enu, pixel) /
                        static_cast<double>(point.pixels.size());
    }
  }
}

}  // namespace

Georegistration Georegister(const Reconstruction& model, const KnownPositions& known,
                            const RunContext& run) {
  Georegistration out;
  out.origin = OriginOf(known);
  const LocalFrame frame(out.origin);
  Rows images = FindImages(model, known.images, frame, out);
  const Rows points = FindPoints(model, known.control_points, frame, out);
  Rows control;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!out.points[i].is_check) control.push_back(points[i]);
  }
  out.by_control_points = control.size() >= 3;
  Rows& rows = out.by_control_points ? control : images;
  if (rows.size() < 3) return out;
  if (!Align(model, run.seed, rows, out)) {
    out.status = GeoregistrationStatus::kOnALine;
    return out;
  }
  Assess(rows, out);
  if (!images.empty()) FinishImages(std::move(images), out);
  FinishPoints(model, points, out);
  size_t next = 0;
  for (GeoregisteredPoint& point : out.points) {
    if (!out.by_control_points) point.is_check = true;
    if (!point.is_check) point.is_wrong = control[next++].is_wrong;
  }
  return out;
}

}  // namespace cairn
