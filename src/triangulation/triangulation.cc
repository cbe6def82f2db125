#include "cairn/triangulation/triangulation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "cairn/math/angles.h"
#include "math/positive_definite.h"

namespace cairn {
namespace {

using Views = std::span<const TriangulationView>;

Eigen::Vector3d Center(const TriangulationView& view) {
  return view.cam_from_world_rotation.transpose() * -view.cam_from_world_translation;
}

Eigen::Vector3d PointInCamera(const TriangulationView& view, const Eigen::Vector3d& xyz) {
  return view.cam_from_world_rotation * xyz + view.cam_from_world_translation;
}

// Infinite behind the camera.
double SquaredErrorPx(const TriangulationView& view, const Eigen::Vector3d& xyz) {
  const Eigen::Vector3d x = PointInCamera(view, xyz);
  if (!(x.z() > 0)) return std::numeric_limits<double>::infinity();
  return (x.hnormalized() - view.ray).squaredNorm() * view.focal_px * view.focal_px;
}

// Inverse variance.
double Precision(const TriangulationView& view) {
  return view.sigma_px > 0 ? 1.0 / (view.sigma_px * view.sigma_px) : 1.0;
}

double MaxErrorPx(const TriangulationView& view, const TriangulationOptions& options) {
  const double max_error_px = options.max_error_px * view.error_scale;
  return view.sigma_px > 0 ? std::min(max_error_px, options.max_error_sigmas * view.sigma_px)
                           : max_error_px;
}

// Below this share of the largest curvature a direction is not determined.
constexpr double kMinPivot = 1e-12;

// The point nearest to all rays, by squared distances, then once more with each distance divided by
// the depth, which makes it an angle. False if the rays are parallel. The result may be behind a
// camera.
template <class Indices>
bool Midpoint(Views views, const Indices& indices, Eigen::Vector3d* xyz) {
  for (int round = 0; round < 2; ++round) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (const int i : indices) {
      const Eigen::Vector3d direction =
          views[i].cam_from_world_rotation.transpose() * views[i].ray.homogeneous().normalized();
      const Eigen::Vector3d center = Center(views[i]);
      double weight = 1.0;
      if (round > 0) weight = 1.0 / std::max((*xyz - center).squaredNorm(), 1e-300);
      const Eigen::Matrix3d across =
          weight * (Eigen::Matrix3d::Identity() - direction * direction.transpose());
      A += across;
      b += across * center;
    }
    if (!SolvePositive<3>(A, b, xyz, kMinPivot)) return false;
  }
  return true;
}

double WeighedError(Views views, const std::vector<int>& indices, const Eigen::Vector3d& xyz) {
  double sum = 0;
  for (const int i : indices) sum += Precision(views[i]) * SquaredErrorPx(views[i], xyz);
  return sum;
}

// Gauss-Newton on the squared reprojection error of the given views; stops where a step does not
// lower it.
void Refine(Views views, const std::vector<int>& indices, int max_steps, Eigen::Vector3d* xyz) {
  double cost = WeighedError(views, indices, *xyz);
  for (int step = 0; step < max_steps; ++step) {
    Eigen::Matrix3d JtJ = Eigen::Matrix3d::Zero();
    Eigen::Vector3d Jtr = Eigen::Vector3d::Zero();
    for (const int i : indices) {
      const TriangulationView& view = views[i];
      const Eigen::Vector3d x = PointInCamera(view, *xyz);
      const double scale = view.focal_px / x.z();
      const Eigen::Vector2d uv = x.hnormalized();
      Eigen::Matrix<double, 2, 3> J_camera;
      J_camera << scale, 0, -scale * uv.x(), 0, scale, -scale * uv.y();
      const Eigen::Matrix<double, 2, 3> J = J_camera * view.cam_from_world_rotation;
      JtJ += Precision(view) * J.transpose() * J;
      Jtr += J.transpose() * (Precision(view) * view.focal_px * (uv - view.ray));
    }
    Eigen::Vector3d delta;
    if (!SolvePositive<3>(JtJ, -Jtr, &delta, kMinPivot)) return;
    const Eigen::Vector3d candidate = *xyz + delta;
    const double candidate_cost = WeighedError(views, indices, candidate);
    if (!(candidate_cost < cost)) return;
    const bool converged = candidate_cost > (1.0 - 1e-9) * cost;
    *xyz = candidate;
    cost = candidate_cost;
    if (converged) return;
  }
}

std::vector<int> Agreeing(Views views, const Eigen::Vector3d& xyz,
                          const TriangulationOptions& options) {
  std::vector<int> agreeing;
  for (size_t i = 0; i < views.size(); ++i) {
    const double max_error_px = MaxErrorPx(views[i], options);
    if (SquaredErrorPx(views[i], xyz) <= max_error_px * max_error_px) {
      agreeing.push_back(static_cast<int>(i));
    }
  }
  return agreeing;
}

// The best point from pairs of views by the sum of squared errors, each in units of the largest
// that is allowed and truncated there. Where there are more pairs than allowed, an even choice of
// them.
bool SearchPairs(Views views, const TriangulationOptions& options, Eigen::Vector3d* best) {
  const int n = static_cast<int>(views.size());
  const int64_t num_pairs = int64_t{n} * (n - 1) / 2;
  std::vector<double> units;
  for (const TriangulationView& view : views) {
    const double max_error_px = MaxErrorPx(view, options);
    units.push_back(1.0 / (max_error_px * max_error_px));
  }
  // Worse than this, fewer than min_views agree.
  double best_score = n - options.min_views + 1;
  bool found = false;
  int64_t pair = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j, ++pair) {
      const auto slot = [&](int64_t p) { return p * options.max_pairs / num_pairs; };
      if (num_pairs > options.max_pairs && slot(pair) == slot(pair + 1)) continue;
      Eigen::Vector3d xyz;
      if (!Midpoint(views, std::array<int, 2>{i, j}, &xyz)) continue;
      double score = 0;
      for (int k = 0; k < n && score < best_score; ++k) {
        score += std::min(units[k] * SquaredErrorPx(views[k], xyz), 1.0);
      }
      if (!(score < best_score)) continue;
      best_score = score;
      *best = xyz;
      found = true;
    }
  }
  return found;
}

}  // namespace

void TriangulationOptions::VisitFields(OptionVisitor& v) {
  v.Double("max_error_px", max_error_px, {0},
           "largest reprojection error, pixels; in proportion for photographs larger than 3200 px");
  v.Double("max_error_sigmas", max_error_sigmas, {0},
           "and in standard deviations of the observation, once they are known");
  v.Double("min_angle_deg", min_angle_deg, {0, 180},
           "smallest angle that two rays of a point must reach, degrees");
  v.Int("min_views", min_views, {2, 1000}, "views that must agree with a point");
  v.Int("max_refinements", max_refinements, {0, 1000}, "Gauss-Newton steps of a point");
  v.Int("max_pairs", max_pairs, {0, 1000000},
        "pairs of views tried where not all views agree; 0: none");
}

TriangulationResult Triangulate(std::span<const TriangulationView> views,
                                const TriangulationOptions& options) {
  TriangulationResult result;
  const auto fail = [&](TriangulationStatus status) {
    result.status = status;
    result.inliers.clear();
    return result;
  };
  const auto min_views = static_cast<size_t>(options.min_views);
  if (views.size() < min_views) return fail(TriangulationStatus::kTooFewViews);

  Eigen::Vector3d xyz;
  std::vector<int> inliers(views.size());
  std::iota(inliers.begin(), inliers.end(), 0);
  const bool well_posed = Midpoint(views, inliers, &xyz);
  inliers = well_posed ? Agreeing(views, xyz, options) : std::vector<int>();
  if (inliers.size() < views.size() && views.size() > 2 && options.max_pairs > 0 &&
      SearchPairs(views, options, &xyz)) {
    inliers = Agreeing(views, xyz, options);
  } else if (!well_posed) {
    return fail(TriangulationStatus::kIllPosed);
  }
  // Refining may bring in views that just missed, or lose some.
  for (int round = 0; round < 3; ++round) {
    if (inliers.size() < min_views) return fail(TriangulationStatus::kTooFewViews);
    Refine(views, inliers, options.max_refinements, &xyz);
    std::vector<int> agreeing = Agreeing(views, xyz, options);
    const bool same = agreeing == inliers;
    inliers = std::move(agreeing);
    if (same) break;
  }
  if (inliers.size() < min_views) return fail(TriangulationStatus::kTooFewViews);

  std::vector<Eigen::Vector3d> centers;
  double sum_error = 0;
  for (const int i : inliers) {
    centers.push_back(Center(views[i]));
    sum_error += std::sqrt(SquaredErrorPx(views[i], xyz));
  }
  if (MaxTriangulationAngleDeg(xyz, std::move(centers), options.min_angle_deg) <
      options.min_angle_deg) {
    return fail(TriangulationStatus::kSmallAngle);
  }
  result.status = TriangulationStatus::kSuccess;
  result.xyz = xyz;
  result.mean_error_px = sum_error / static_cast<double>(inliers.size());
  result.inliers = std::move(inliers);
  return result;
}

double MaxTriangulationAngleDeg(const Eigen::Vector3d& xyz, std::vector<Eigen::Vector3d> centers,
                                double enough_deg) {
  std::vector<Eigen::Vector3d>& rays = centers;  // in their place, one after the other
  double min_cosine = 1.0, widest_deg = 0.0;
  for (size_t i = 0; i < centers.size(); ++i) {
    rays[i] = (xyz - centers[i]).normalized();
    for (size_t j = 0; j < i; ++j) {
      const double cosine = rays[i].dot(rays[j]);
      if (!(cosine < min_cosine)) continue;
      min_cosine = cosine;
      widest_deg = RadToDeg(std::acos(std::max(cosine, -1.0)));
      if (widest_deg >= enough_deg) return widest_deg;
    }
  }
  return widest_deg;
}

}  // namespace cairn
