#include "intrinsics/camera_pairs.h"

#include <algorithm>
#include <array>

#include "base/hash.h"
#include "database/stage_names.h"

namespace cairn {

std::map<image_t, camera_t> CamerasOfImages(const Database& database) {
  std::map<image_t, camera_t> cameras;
  for (const Image& image : database.ReadImages()) cameras[image.image_id] = image.camera_id;
  return cameras;
}

uint64_t DrawingOrder(image_pair_t pair) { return Hasher().Add(pair).Digest(); }

std::vector<image_pair_t> DrawPairs(std::vector<image_pair_t> pairs,
                                    const std::map<image_t, camera_t>& camera_of,
                                    const std::set<camera_t>& wanted, int max_per_camera) {
  std::sort(pairs.begin(), pairs.end(),
            [](image_pair_t a, image_pair_t b) { return DrawingOrder(a) < DrawingOrder(b); });
  std::map<camera_t, int> counts;
  std::vector<image_pair_t> drawn;
  for (const image_pair_t pair : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    const auto camera1 = camera_of.find(id1), camera2 = camera_of.find(id2);
    if (camera1 == camera_of.end() || camera2 == camera_of.end()) continue;
    const std::set<camera_t> cameras = {camera1->second, camera2->second};
    const bool is_wanted = std::any_of(cameras.begin(), cameras.end(), [&](camera_t id) {
      return wanted.count(id) > 0 && counts[id] < max_per_camera;
    });
    if (!is_wanted) continue;
    for (const camera_t id : cameras) ++counts[id];
    drawn.push_back(pair);
  }
  std::sort(drawn.begin(), drawn.end());
  return drawn;
}

bool IsOfCameras(image_pair_t pair, const std::map<image_t, camera_t>& camera_of,
                 const std::set<camera_t>& cameras) {
  const auto [id1, id2] = PairIdToImagePair(pair);
  return std::ranges::any_of(std::array{id1, id2}, [&](image_t id) {
    const auto camera = camera_of.find(id);
    return camera != camera_of.end() && cameras.count(camera->second) > 0;
  });
}

std::vector<image_pair_t> UndoVerification(Database& database,
                                           const std::map<image_t, camera_t>& camera_of,
                                           const std::set<camera_t>& cameras) {
  std::vector<image_pair_t> undone;
  if (cameras.empty()) return undone;
  for (const JobRecord& job : database.ReadJobs(kStageVerification)) {
    if (IsOfCameras(job.item, camera_of, cameras)) undone.push_back(job.item);
  }
  for (const image_pair_t pair : undone) {
    database.DeletePairResults(pair);
    database.DeleteJob(kStageVerification, pair);
  }
  return undone;
}

}  // namespace cairn
