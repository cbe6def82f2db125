#include <algorithm>
#include <cmath>

#include "cairn/base/parallel.h"
#include "cairn/math/median.h"
#include "cairn/triangulation/triangulation.h"
#include "report_page/page_parts.h"

namespace cairn {
namespace {

// 1, 2 or 5 times a power of ten, at least `value`.
double RoundUp(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= value) return factor * power;
  }
  return 10 * power;
}

// Some 20 bins of a round width up to the 98th percentile; what lies beyond is in the last one.
// Whole numbers get bins of whole width.
Json Histogram(const char* title, const char* unit, std::vector<double> values,
               bool are_whole = false) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return Json();
  std::sort(values.begin(), values.end());
  const double high = values[static_cast<size_t>(0.98 * static_cast<double>(values.size() - 1))];
  const double lowest = are_whole ? std::floor(values.front()) : 0.0;
  double width = RoundUp(std::max(high - lowest, 1e-9) / 30);
  if (are_whole) width = std::max(1.0, width);
  const int num_bins = static_cast<int>(std::clamp((high - lowest) / width, 0.0, 1000.0)) + 1;
  std::vector<int64_t> counts(num_bins, 0);
  for (const double value : values) {
    const double bin = std::clamp((value - lowest) / width, 0.0, num_bins - 1.0);
    ++counts[static_cast<int>(bin)];
  }
  return {{"title", title},
          {"unit", unit},
          {"lowest", lowest},
          {"width", width},
          {"counts", counts},
          {"num", values.size()},
          {"median", UpperMedian(values)},
          {"largest", values.back()},
          {"is_cut", values.back() >= lowest + num_bins * width}};
}

// The largest angle between the rays of each point of all models.
std::vector<double> TriangulationAngles(const PageScene& scene) {
  std::vector<double> all;
  for (const Reconstruction& model : scene.input.models) {
    std::vector<const Point3D*> points;
    for (const auto& [id, point] : model.points3D) points.push_back(&point);
    std::vector<double> angles(points.size());
    ParallelFor(
        scene.run.num_threads, static_cast<int64_t>(points.size()),
        [&](int64_t i) {
          std::vector<Eigen::Vector3d> centers;
          for (const TrackElement& element : points[i]->track) {
            centers.push_back(model.images.at(element.image_id).cam_from_world.Center());
          }
          angles[i] = MaxTriangulationAngleDeg(points[i]->xyz, std::move(centers));
        },
        /*grain=*/1024);
    all.insert(all.end(), angles.begin(), angles.end());
  }
  return all;
}

}  // namespace

Json HistogramsJson(const PageScene& scene) {
  std::vector<double> inliers, removed_inliers, residuals, lengths, errors;
  for (const PagePair& pair : scene.pairs) {
    if (pair.InUse()) {
      inliers.push_back(pair.num_inliers);
      if (pair.residual_px > 0) residuals.push_back(pair.residual_px);
    } else if (pair.removal) {
      removed_inliers.push_back(pair.num_inliers);
    }
  }
  for (const Reconstruction& model : scene.input.models) {
    for (const auto& [id, point] : model.points3D) {
      lengths.push_back(static_cast<double>(point.track.size()));
    }
  }
  for (const PageImage& image : scene.images) {
    if (image.num_points > 0) errors.push_back(image.error_px);
  }
  Json all = {Histogram("Inliers of pairs in use", "matches", inliers, true),
              Histogram("Inliers of pairs that were taken out", "matches", removed_inliers, true),
              Histogram("Residuals of pairs in use (median Sampson error)", "px", residuals),
              Histogram("Photos that see a point", "photos", lengths, true),
              Histogram("Largest triangulation angle of a point", "°", TriangulationAngles(scene)),
              Histogram("Mean reprojection error of a photo", "px", errors)};
  Json present = Json::array();
  for (Json& histogram : all) {
    if (!histogram.is_null()) present.push_back(std::move(histogram));
  }
  return present;
}

}  // namespace cairn
