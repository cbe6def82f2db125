#include "intrinsics/shared_lenses.h"

#include <algorithm>
#include <tuple>
#include <vector>

#include "intrinsics/camera_pairs.h"
#include "intrinsics/known_intrinsics.h"

namespace cairn {

SharedLenses FindSharedLenses(const Database& database) {
  const std::map<image_t, camera_t> camera_of = CamerasOfImages(database);
  std::map<camera_t, int> num_images;
  for (const auto& [image, id] : camera_of) ++num_images[id];
  using Kind = std::tuple<CameraModel, int, int, bool, double>;
  std::map<Kind, std::vector<camera_t>> kinds;
  const auto known = ReadKnownIntrinsics(database);
  for (const Camera& camera : database.ReadCameras()) {
    if (num_images[camera.camera_id] != 1 || known.at(camera.camera_id).is_given ||
        LooksMeasured(camera)) {
      continue;
    }
    const auto [shorter, longer] = std::minmax(camera.width, camera.height);
    kinds[{camera.model, shorter, longer, camera.has_prior_focal_length, camera.MeanFocal()}]
        .push_back(camera.camera_id);
  }
  SharedLenses shared;
  for (const auto& [kind, cameras] : kinds) {
    if (2 * cameras.size() <= camera_of.size()) continue;
    for (const camera_t id : cameras) shared[id] = cameras.front();
  }
  return shared;
}

void AdoptLenses(Database& database) {
  const std::map<camera_t, CameraLens> lenses = database.ReadCameraLenses();
  std::map<camera_t, std::vector<CameraLens>> learned;
  const SharedLenses shared = FindSharedLenses(database);
  for (const auto& [id, first] : shared) {
    const auto lens = lenses.find(id);
    if (lens != lenses.end() && !lens->second.IsEmpty()) learned[first].push_back(lens->second);
  }
  for (auto& [first, of_lens] : learned) {
    std::ranges::nth_element(of_lens, of_lens.begin() + std::ssize(of_lens) / 2, {},
                             &CameraLens::focal_px);
  }
  Database::Transaction transaction(database);
  for (const auto& [id, first] : shared) {
    if (lenses.count(id) > 0 || learned.count(first) == 0) continue;
    CameraLens lens = learned[first][learned[first].size() / 2];
    lens.num_pairs = 0;
    lens.is_focal_known = false;  // of this camera
    database.WriteCameraLens(id, lens);
  }
  transaction.Commit();
}

}  // namespace cairn
