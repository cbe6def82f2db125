#include <algorithm>
#include <cstdlib>
#include <tuple>

#include "cairn/base/parallel.h"
#include "cairn/pair_selection/pair_selection.h"
#include "math/sorted_order.h"

namespace cairn {

std::vector<image_pair_t> SpatialPairs(const std::map<image_t, GpsPosition>& positions,
                                       int neighbors, double radius_m, int num_threads) {
  std::vector<image_t> images;
  std::vector<Eigen::Vector3d> points;
  for (const auto& [image, gps] : positions) {
    images.push_back(image);
    points.push_back(EarthCentered({gps.latitude_deg, gps.longitude_deg}));
  }
  const auto num = static_cast<int64_t>(images.size());
  std::vector<std::vector<image_pair_t>> pairs_of(images.size());
  ParallelFor(num_threads, num, [&](int64_t i) {
    // Of equally near ones, as indoors, those next in the order of ids, which is that of names.
    std::vector<std::tuple<double, int64_t, image_t>> here, elsewhere;
    for (int64_t j = 0; j < num; ++j) {
      const double distance = (points[i] - points[j]).norm();
      if (j == i || distance > radius_m) continue;
      (distance > 0 ? elsewhere : here).emplace_back(distance, std::abs(j - i), images[j]);
    }
    for (auto* near : {&here, &elsewhere}) {
      const auto kept = std::min(std::ssize(*near), static_cast<int64_t>(neighbors));
      std::partial_sort(near->begin(), near->begin() + kept, near->end());
      for (int64_t k = 0; k < kept; ++k) {
        pairs_of[i].push_back(ImagePairToPairId(images[i], std::get<image_t>((*near)[k])));
      }
    }
  });
  std::vector<image_pair_t> pairs;
  for (const auto& of_image : pairs_of) pairs.insert(pairs.end(), of_image.begin(), of_image.end());
  return Unique(std::move(pairs));
}

}  // namespace cairn
