#include <algorithm>

#include "cairn/base/parallel.h"
#include "cairn/database/database.h"
#include "cairn/synthetic/scene.h"
#include "synthetic/visible_points.h"

namespace cairn {
namespace {

constexpr int kPairsPerTransaction = 1000;

// One pair's rows, made in parallel, written in order.
struct PairRows {
  FeatureMatches matches;
  TwoViewGeometry geometry;
};

void WritePairs(const SyntheticScene& scene, bool with_geometries, Database& database) {
  std::vector<VisiblePoints> visible;
  for (const Image& image : scene.images) {
    visible.push_back(FindVisiblePoints(scene, image.image_id));
  }
  const int64_t n = static_cast<int64_t>(scene.images.size());
  std::vector<std::pair<int64_t, int64_t>> pairs;
  const auto write = [&] {
    std::vector<PairRows> rows(pairs.size());
    ParallelFor(0, static_cast<int64_t>(pairs.size()), [&](int64_t k) {
      const auto [i, j] = pairs[k];
      const image_t id1 = scene.images[i].image_id;
      const image_t id2 = scene.images[j].image_id;
      const SyntheticMatches matches = MakeMatches(scene, id1, id2, visible[i], visible[j]);
      if (with_geometries &&
          std::count(matches.is_inlier.begin(), matches.is_inlier.end(), true) > 0) {
        rows[k].geometry = TrueTwoViewGeometry(scene, id1, id2, matches);
      }
      rows[k].matches = matches.matches;
    });
    Database::Transaction transaction(database);
    for (size_t k = 0; k < pairs.size(); ++k) {
      const image_pair_t pair_id = ImagePairToPairId(scene.images[pairs[k].first].image_id,
                                                     scene.images[pairs[k].second].image_id);
      if (rows[k].matches.empty()) continue;
      database.WriteMatches(pair_id, rows[k].matches);
      if (with_geometries) database.WriteTwoViewGeometry(pair_id, rows[k].geometry);
    }
    transaction.Commit();
    pairs.clear();
  };
  for (int64_t i = 0; i < n; ++i) {
    for (int64_t j = i + 1; j < n; ++j) {
      pairs.emplace_back(i, j);
      if (pairs.size() == kPairsPerTransaction) write();
    }
  }
  write();
}

}  // namespace

void WriteScene(const SyntheticScene& scene, SceneContent content, Database& database) {
  Database::Transaction transaction(database);
  for (const auto& [id, camera] : scene.cameras) database.WriteCamera(camera);
  for (const Image& image : scene.images) {
    database.WriteImage(image);
    database.WriteKeypoints(image.image_id, scene.keypoints.at(image.image_id));
    database.WriteDescriptors(image.image_id, MakeDescriptors(scene, image.image_id));
    if (content >= SceneContent::kDepth) {
      database.WriteDepthSamples(image.image_id, scene.depth_samples.at(image.image_id));
    }
  }
  transaction.Commit();
  if (content >= SceneContent::kMatches) {
    WritePairs(scene, content >= SceneContent::kTwoViewGeometries, database);
  }
}

}  // namespace cairn
