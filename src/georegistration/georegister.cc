#include "cairn/georegistration/georegister.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "cairn/evaluation/alignment.h"
#include "cairn/evaluation/error_statistics.h"
#include "cairn/math/angles.h"

namespace cairn {
namespace {

// The median length of three normal coordinates, in standard deviations of one of them.
constexpr double kMedianLength = 1.5382;
// Tukey's fence for what is far out (Exploratory Data Analysis, 1977): so many quartile distances
// beyond the upper quartile. Of three normal coordinates it lies at 4.80 standard deviations, which
// 1 in 25,000 exceed; tails that are longer, as those of a model that bends, move it outwards.
constexpr double kFarOut = 3.0;
constexpr double kNormalFence = 4.80;
// The first guess at what agrees: residuals up to so many medians, 4.6 standard deviations.
constexpr double kFirstMedians = 3.0;
// No receiver is better than this (differential GPS, fixed), meters.
constexpr double kMinSigmaM = 0.01;
constexpr int kMaxRounds = 50;
// Cameras whose path is this much longer than wide are on a line but for rounding.
constexpr double kMinWidth = 1e-6;

using Points = std::vector<Eigen::Vector3d>;

// What is aligned: rows of the images, and of each the center in the model.
struct Problem {
  Points centers, positions;
  std::vector<double> sigmas_m;
};

GpsPosition MedianPosition(const std::vector<GeoregisteredImage>& images) {
  std::vector<double> latitudes, longitudes, altitudes;
  for (const GeoregisteredImage& image : images) {
    latitudes.push_back(image.gps.latitude_deg);
    longitudes.push_back(image.gps.longitude_deg);
    if (image.gps.altitude_m) altitudes.push_back(*image.gps.altitude_m);
  }
  GpsPosition middle{Median(std::move(latitudes)), Median(std::move(longitudes))};
  if (!altitudes.empty()) middle.altitude_m = Median(std::move(altitudes));
  return middle;
}

// The images that have positions, and (unless none has) an altitude.
Problem FindImages(const Reconstruction& model, const std::map<std::string, GpsRow>& rows,
                   Georegistration& out) {
  const bool need_altitude = std::any_of(model.images.begin(), model.images.end(), [&](auto& item) {
    const auto row = rows.find(item.second.image.name);
    return row != rows.end() && row->second.position.altitude_m;
  });
  Problem problem;
  for (const auto& [id, image] : model.images) {
    const auto row = rows.find(image.image.name);
    if (row == rows.end()) continue;
    if (need_altitude && !row->second.position.altitude_m) {
      out.without_altitude.push_back(image.image.name);
      continue;
    }
    GeoregisteredImage& found = out.images.emplace_back();
    found.image_id = id;
    found.name = image.image.name;
    found.gps = row->second.position;
    problem.centers.push_back(image.cam_from_world.Center());
    problem.sigmas_m.push_back(row->second.sigma_m);
  }
  if (out.images.empty()) return problem;
  // Rows without sigma are as good as the middle one of those that have it.
  std::vector<double> given;
  std::copy_if(problem.sigmas_m.begin(), problem.sigmas_m.end(), std::back_inserter(given),
               [](double sigma) { return sigma > 0; });
  const double usual = given.empty() ? 1.0 : Median(given);
  for (double& sigma : problem.sigmas_m) sigma = sigma > 0 ? sigma : usual;
  out.origin = MedianPosition(out.images);
  const LocalFrame frame(out.origin);
  for (GeoregisteredImage& image : out.images) {
    image.gps_enu = frame.FromGps(image.gps);
    problem.positions.push_back(image.gps_enu);
  }
  return problem;
}

// Residuals under the similarity; their lengths, divided by the sigmas.
std::vector<double> Measure(const Problem& problem, const std::vector<double>& sigmas_m,
                            Georegistration& out) {
  std::vector<double> relative;
  for (size_t i = 0; i < out.images.size(); ++i) {
    out.images[i].residual = out.enu_from_world * problem.centers[i] - problem.positions[i];
    relative.push_back(out.images[i].residual.norm() / sigmas_m[i]);
  }
  return relative;
}

// Beyond which a relative residual is far out, by those of the rows that are not wrong.
double Fence(const std::vector<double>& relative, const Georegistration& out) {
  std::vector<double> kept;
  for (size_t i = 0; i < relative.size(); ++i) {
    if (!out.images[i].is_wrong) kept.push_back(relative[i]);
  }
  std::sort(kept.begin(), kept.end());
  const double lower = kept[kept.size() / 4], upper = kept[(3 * kept.size()) / 4];
  return upper + kFarOut * (upper - lower);
}

// Says which rows are wrong; whether any answer changed.
bool Judge(const Problem& problem, Georegistration& out) {
  const std::vector<double> relative = Measure(problem, problem.sigmas_m, out);
  const double fence = Fence(relative, out);
  bool has_changed = false;
  for (size_t i = 0; i < out.images.size(); ++i) {
    const double largest_m = std::max(fence * problem.sigmas_m[i], kNormalFence * kMinSigmaM);
    const bool is_wrong = out.images[i].residual.norm() > largest_m;
    has_changed |= is_wrong != out.images[i].is_wrong;
    out.images[i].is_wrong = is_wrong;
  }
  return has_changed;
}

// Least squares over the rows that are not wrong.
std::optional<Sim3d> Fit(const Problem& problem, const Georegistration& out) {
  Points centers, positions;
  std::vector<double> weights;
  for (size_t i = 0; i < out.images.size(); ++i) {
    if (out.images[i].is_wrong) continue;
    centers.push_back(problem.centers[i]);
    positions.push_back(problem.positions[i]);
    weights.push_back(1.0 / (problem.sigmas_m[i] * problem.sigmas_m[i]));
  }
  return AlignSimilarity(centers, positions, weights);
}

// Standard deviations of the points along their principal axes, the smallest first.
Eigen::Vector3d Extents(const Points& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point / static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points) {
    covariance += (point - mean) * (point - mean).transpose() / static_cast<double>(points.size());
  }
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance)
      .eigenvalues()
      .cwiseMax(0)
      .cwiseSqrt();
}

// Fills the figures of the final fit, and its status.
void Assess(const Problem& problem, Georegistration& out) {
  Points kept;
  std::vector<double> residuals, distances;
  for (size_t i = 0; i < out.images.size(); ++i) {
    if (out.images[i].is_wrong) continue;
    kept.push_back(out.enu_from_world * problem.centers[i]);
    residuals.push_back(out.images[i].residual.norm());
    distances.push_back(problem.positions[i].norm());  // from their middle
  }
  out.median_residual_m = Median(residuals);
  const Eigen::Vector3d extents = Extents(kept);
  if (!(extents[1] > kMinWidth * extents[2])) {
    out.status = GeoregistrationStatus::kOnALine;
    return;
  }
  const double sigma_m = out.median_residual_m / kMedianLength;
  out.roll_sigma_deg = RadToDeg(std::atan(sigma_m / (std::hypot(extents[0], extents[1]) *
                                                     std::sqrt(static_cast<double>(kept.size())))));
  // A similarity that shrinks the model to a point explains nothing, and leaves the distances.
  out.status = out.median_residual_m > 0.5 * Median(distances) ? GeoregistrationStatus::kNoAgreement
                                                               : GeoregistrationStatus::kOk;
}

}  // namespace

Georegistration Georegister(const Reconstruction& model, const std::map<std::string, GpsRow>& rows,
                            const RunContext& run) {
  Georegistration out;
  const Problem problem = FindImages(model, rows, out);
  if (out.images.size() < 3) return out;
  const auto start = AlignSimilarityRobust(problem.centers, problem.positions, run.seed);
  if (!start) {
    out.status = GeoregistrationStatus::kOnALine;
    return out;
  }
  out.enu_from_world = *start;
  // The start does not know sigmas: precise rows are not wrong because it is off.
  const std::vector<double> residuals_m =
      Measure(problem, std::vector<double>(problem.sigmas_m.size(), 1.0), out);
  const double largest_m = std::max(kFirstMedians * Median(residuals_m), kNormalFence * kMinSigmaM);
  for (size_t i = 0; i < residuals_m.size(); ++i) {
    out.images[i].is_wrong = residuals_m[i] > largest_m;
  }
  for (int round = 0; round < kMaxRounds; ++round) {
    const std::optional<Sim3d> fit = Fit(problem, out);
    if (!fit) break;
    out.enu_from_world = *fit;
    if (!Judge(problem, out)) break;
  }
  Assess(problem, out);
  return out;
}

}  // namespace cairn
