#include "bundle_adjustment/bundle_observations.h"

#include <algorithm>
#include <utility>

#include "cairn/base/parallel.h"
#include "scene/view_table.h"

namespace cairn {

BundleObservations CollectObservations(const BundleAdjustmentScope& scope,
                                       const Reconstruction& reconstruction) {
  const ViewTable views(reconstruction);
  BundleObservations result;
  result.all.reserve(reconstruction.NumObservations());
  result.of_image.resize(views.size());
  const auto add = [&](const ViewTable::View& view, const Eigen::Vector2d& pixel, float sigma_px,
                       const Eigen::Vector3d& xyz) {
    if (!view.camera->ImgFromRay(view.image->cam_from_world * xyz)) return;
    result.all.push_back({pixel, 1.0F / sigma_px, view.index});
  };
  const auto end_point = [&] {
    std::sort(result.all.begin() + result.begin.back(), result.all.end(),
              [](const auto& a, const auto& b) { return a.image < b.image; });
    result.point_of.resize(result.all.size(), result.NumPoints());
    result.begin.push_back(static_cast<int>(result.all.size()));
  };
  for (const auto& [id, point] : reconstruction.points3D) {
    for (const TrackElement& element : point.track) {
      const ViewTable::View& view = views.Of(element.image_id);
      add(view, view.Pixel(element.point2D), static_cast<float>(view.SigmaPx(element.point2D)),
          point.xyz);
    }
    end_point();
  }
  result.num_unsurveyed = result.NumPoints();
  for (const SurveyedPoint& point : scope.surveyed_points) {
    for (const auto& [id, pixel] : point.pixels) {
      add(views.Of(id), pixel, 1.0F, point.prior.position);
    }
    end_point();
  }
  for (size_t k = 0; k < result.all.size(); ++k) {
    result.of_image[result.all[k].image].push_back(static_cast<int>(k));
  }
  return result;
}

std::vector<std::vector<int>> ImagesSeenTogether(const BundleObservations& observations,
                                                 int num_threads) {
  std::vector<std::vector<int>> columns(observations.of_image.size());
  std::vector<std::vector<int>> found_for(EffectiveNumThreads(num_threads));  // by worker
  const auto find = [&](int worker, int64_t row) {
    const auto i = static_cast<int>(row);
    std::vector<int>& found = found_for[worker];
    found.resize(columns.size(), -1);
    found[i] = i;
    columns[i].push_back(i);
    for (const int a : observations.of_image[i]) {
      for (int b = a + 1; b < observations.begin[observations.point_of[a] + 1]; ++b) {
        const int j = observations.all[b].image;
        if (std::exchange(found[j], i) != i) columns[i].push_back(j);
      }
    }
    std::sort(columns[i].begin(), columns[i].end());
  };
  ParallelForWorker(num_threads, static_cast<int64_t>(columns.size()), find, /*grain=*/4);
  return columns;
}

}  // namespace cairn
