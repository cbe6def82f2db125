#include "bundle_adjustment/bundle_observations.h"

#include <algorithm>
#include <utility>

#include "cairn/base/parallel.h"
#include "scene/view_table.h"

namespace cairn {

namespace {

constexpr int64_t kPointsPerPart = 1024;  // that one thread looks at

// Those of points one after the other, and how many each has.
struct Part {
  std::vector<BundleObservation> all;
  std::vector<int> nums;
};

class Collector {
 public:
  Collector(const BundleAdjustmentScope& scope, const Reconstruction& reconstruction)
      : surveyed_(scope.surveyed_points), views_(reconstruction) {
    for (const auto& [id, point] : reconstruction.points3D) points_.push_back(&point);
  }

  int64_t NumPoints() const { return NumUnsurveyed() + std::ssize(surveyed_); }
  int64_t NumUnsurveyed() const { return std::ssize(points_); }
  size_t NumImages() const { return views_.size(); }

  void AddPoint(int64_t p, Part& part) const {
    const auto num_before = std::ssize(part.all);
    if (p < NumUnsurveyed()) {
      for (const TrackElement& element : points_[p]->track) {
        const ViewTable::View& view = views_.Of(element.image_id);
        Add(view, view.Pixel(element.point2D), static_cast<float>(view.SigmaPx(element.point2D)),
            points_[p]->xyz, part);
      }
    } else {
      const SurveyedPoint& point = surveyed_[p - NumUnsurveyed()];
      for (const auto& [id, pixel] : point.pixels) {
        Add(views_.Of(id), pixel, 1.0F, point.prior.position, part);
      }
    }
    std::sort(part.all.begin() + num_before, part.all.end(),
              [](const auto& a, const auto& b) { return a.image < b.image; });
    part.nums.push_back(static_cast<int>(std::ssize(part.all) - num_before));
  }

 private:
  static void Add(const ViewTable::View& view, const Eigen::Vector2d& pixel, float sigma_px,
                  const Eigen::Vector3d& xyz, Part& part) {
    if (!view.camera->ImgFromRay(view.image->cam_from_world * xyz)) return;
    part.all.push_back({pixel, 1.0F / sigma_px, view.index});
  }

  std::vector<const Point3D*> points_;
  const std::vector<SurveyedPoint>& surveyed_;
  const ViewTable views_;
};

}  // namespace

BundleObservations CollectObservations(const BundleAdjustmentScope& scope,
                                       const Reconstruction& reconstruction, int num_threads) {
  const Collector collector(scope, reconstruction);
  const int64_t num_points = collector.NumPoints();
  std::vector<Part> parts((num_points + kPointsPerPart - 1) / kPointsPerPart);
  ParallelFor(num_threads, std::ssize(parts), [&](int64_t k) {
    const int64_t end = std::min(num_points, (k + 1) * kPointsPerPart);
    for (int64_t p = k * kPointsPerPart; p < end; ++p) collector.AddPoint(p, parts[k]);
  });
  BundleObservations result;
  result.num_unsurveyed = static_cast<int>(collector.NumUnsurveyed());
  result.of_image.resize(collector.NumImages());
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
