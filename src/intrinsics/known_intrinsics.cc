#include "intrinsics/known_intrinsics.h"

#include "cairn/base/check.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

bool CamerasWereGiven(const Database& database) {
  const std::optional<StageRecord> stage = database.ReadStage(kStageCameras);
  if (!stage) return false;
  const std::map<std::string, std::string> options = stage->OptionValues();
  const auto params = options.find("camera_params");
  return params != options.end() && params->second != "[]";
}

template <class Value>
std::optional<Value> FindRow(const std::map<camera_t, Value>& values, camera_t id) {
  const auto it = values.find(id);
  return it == values.end() ? std::nullopt : std::optional<Value>(it->second);
}

}  // namespace

bool KnownIntrinsics::IsConstant() const {
  return is_given || (LooksMeasured(camera) && !IsRejected() && !HasLearned());
}

void ApplyLens(const CameraLens& lens, Camera& camera) {
  if (lens.focal_px > 0) camera.SetMeanFocal(lens.focal_px);
  const std::vector<int> indices = camera.DistortionIndices();
  // (Another program may have stored another model since.)
  if (lens.k != 0 && !indices.empty()) camera.params[indices[0]] = lens.k;
}

bool IsCentered(const Camera& camera) {
  const Eigen::Vector2d center(0.5 * camera.width, 0.5 * camera.height);
  return (camera.PrincipalPoint() - center).cwiseAbs().maxCoeff() <= 0.5 + 1e-9;
}

bool LooksMeasured(const Camera& camera) {
  const Camera plain = Camera::FromFocal(camera.camera_id, camera.model, camera.MeanFocal(),
                                         camera.width, camera.height);
  bool is_distorted = false;
  for (const int k : camera.DistortionIndices()) {
    is_distorted |= camera.params[k] != plain.params[k] && camera.params[k] != 0;
  }
  return !IsCentered(camera) || camera.FocalX() != camera.FocalY() || is_distorted;
}

std::map<camera_t, KnownIntrinsics> ReadKnownIntrinsics(const Database& database) {
  const std::map<camera_t, CameraLens> lenses = database.ReadCameraLenses();
  const std::map<camera_t, CameraFocal> judgements = database.ReadCameraFocals();
  const bool are_given = CamerasWereGiven(database);
  std::map<camera_t, KnownIntrinsics> known;
  for (Camera& camera : database.ReadCameras()) {
    const camera_t id = camera.camera_id;
    KnownIntrinsics& intrinsics = known[id];
    intrinsics = {std::move(camera), FindRow(lenses, id), FindRow(judgements, id), are_given};
    if (intrinsics.lens) ApplyLens(*intrinsics.lens, intrinsics.camera);
  }
  return known;
}

}  // namespace cairn
