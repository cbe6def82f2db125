#include "bundle_adjustment/bundle_observations.h"

#include <algorithm>

#include "cairn/base/parallel.h"
#include "scene/view_table.h"
#include "sparse/block_cholesky.h"

namespace cairn {

namespace {

constexpr int64_t kPointsPerPart = 1024;  // that one thread looks at

// Those of points one after the other, and how many each has.
struct Part {
  std::vector<BundleObservation> all;
  std::vector<int> nums;

  void Add(const ViewTable::View& view, const Eigen::Vector2d& pixel, float sigma_px,
           const Eigen::Vector3d& xyz) {
    if (!view.camera->ImgFromRay(view.image->cam_from_world * xyz)) return;
    all.push_back({pixel, 1.0F / sigma_px, view.index});
  }
};

}  // namespace

BundleObservations CollectObservations(const BundleAdjustmentScope& scope,
                                       const Reconstruction& reconstruction, int num_threads) {
  const ViewTable views(reconstruction);
  std::vector<const Point3D*> unsurveyed;
  for (const auto& [id, point] : reconstruction.points3D) unsurveyed.push_back(&point);
  const auto num_unsurveyed = std::ssize(unsurveyed);
  const int64_t num_points = num_unsurveyed + std::ssize(scope.surveyed_points);
  const auto add_point = [&](int64_t p, Part& part) {
    const auto num_before = std::ssize(part.all);
    if (p < num_unsurveyed) {
      for (const TrackElement& element : unsurveyed[p]->track) {
        const ViewTable::View& view = views.Of(element.image_id);
        part.Add(view, view.Pixel(element.point2D),
                 static_cast<float>(view.SigmaPx(element.point2D)), unsurveyed[p]->xyz);
      }
    } else {
      const SurveyedPoint& point = scope.surveyed_points[p - num_unsurveyed];
      for (const auto& [id, pixel] : point.pixels) {
        part.Add(views.Of(id), pixel, 1.0F, point.prior.position);
      }
    }
    std::sort(part.all.begin() + num_before, part.all.end(),
              [](const auto& a, const auto& b) { return a.image < b.image; });
    part.nums.push_back(static_cast<int>(std::ssize(part.all) - num_before));
  };
  std::vector<Part> parts((num_points + kPointsPerPart - 1) / kPointsPerPart);
  ParallelFor(num_threads, std::ssize(parts), [&](int64_t k) {
    const int64_t end = std::min(num_points, (k + 1) * kPointsPerPart);
    for (int64_t p = k * kPointsPerPart; p < end; ++p) add_point(p, parts[k]);
  });
  BundleObservations result;
  result.num_unsurveyed = static_cast<int>(num_unsurveyed);
  result.of_image.resize(views.size());
  size_t num_observations = 0;
  for (const Part& part : parts) num_observations += part.all.size();
  result.all.reserve(num_observations);
  result.point_of.reserve(num_observations);
  result.begin.reserve(num_points + 1);
  for (Part& part : parts) {
    for (const int num : part.nums) {
      result.point_of.resize(result.point_of.size() + num, result.NumPoints());
      result.begin.push_back(result.begin.back() + num);
    }
    for (const BundleObservation& observation : part.all) {
      result.of_image[observation.image].push_back(static_cast<int>(result.all.size()));
      result.all.push_back(observation);
    }
    part = {};
  }
  return result;
}

std::vector<std::vector<int>> ImagesSeenTogether(const BundleObservations& observations,
                                                 int num_threads) {
  const auto visit = [&](int i, const auto& use) {
    for (const int a : observations.of_image[i]) {
      const int end = observations.begin[observations.point_of[a] + 1];
      for (int b = a + 1; b < end; ++b) use(observations.all[b].image);
    }
  };
  return JoinedColumns(static_cast<int>(observations.of_image.size()), num_threads, visit);
}

}  // namespace cairn
