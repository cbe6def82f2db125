#include "pipeline/learned_cameras.h"

#include "cairn/base/check.h"

namespace cairn {

void ApplyLens(const CameraLens& lens, Camera* camera) {
  if (lens.focal_px > 0) camera->SetMeanFocal(lens.focal_px);
  if (lens.k == 0) return;
  const std::vector<int> indices = camera->DistortionIndices();
  CAIRN_CHECK(!indices.empty());
  camera->params[indices[0]] = lens.k;
}

std::vector<Camera> ReadLearnedCameras(const Database& database) {
  const std::map<camera_t, CameraLens> lenses = database.ReadCameraLenses();
  std::vector<Camera> cameras = database.ReadCameras();
  for (Camera& camera : cameras) {
    const auto lens = lenses.find(camera.camera_id);
    if (lens != lenses.end()) ApplyLens(lens->second, &camera);
  }
  return cameras;
}

}  // namespace cairn
