#include "pipeline/stages/fisheye_lenses.h"

#include <algorithm>
#include <set>
#include <string>

#include "intrinsics/camera_pairs.h"
#include "intrinsics/known_intrinsics.h"
#include "pipeline/stages/camera_maker.h"
#include "report/stage.h"

namespace cairn {
namespace {

// k r_d^2 where the distorted radius r_d = r (1 + k r^2) is largest.
constexpr double kFold = -4.0 / 27;
constexpr double kBeyondDoubt = 3;  // standard deviations

bool IsBeyondFold(const KnownIntrinsics& known) {
  const Camera& camera = known.camera;
  const bool may_be = camera.model == CameraModel::kSimpleRadial && known.lens &&
                      !camera.has_prior_focal_length && !known.is_given;
  if (!may_be) return false;
  const double corner = 0.5 * camera.DiagonalPx() / camera.MeanFocal();
  return (known.lens->k + kBeyondDoubt * known.lens->k_sigma) * corner * corner < kFold;
}

// The cameras of photographs that we imported.
std::set<camera_t> OwnCameras(const Database& database) {
  std::set<std::string> names;
  for (const PhotoRecord& photo : database.ReadPhotos()) names.insert(photo.name);
  std::set<camera_t> cameras;
  for (const Image& image : database.ReadImages()) {
    if (names.count(image.name) > 0) cameras.insert(image.camera_id);
  }
  return cameras;
}

}  // namespace

StageReport TakeFisheyes(Database& database, const RunContext& run) {
  Stage stage(run.monitor, "fisheye_lenses");
  const std::set<camera_t> own = OwnCameras(database);
  std::set<camera_t> fisheyes;
  Database::Transaction transaction(database);
  for (const auto& [id, known] : ReadKnownIntrinsics(database)) {
    if (own.count(id) == 0 || !IsBeyondFold(known)) continue;
    const auto [width, height] = std::pair(known.camera.width, known.camera.height);
    constexpr CameraModel kModel = CameraModel::kSimpleRadialFisheye;
    database.WriteCamera(Camera::FromFocal(
        id, kModel, FocalFactor(kModel) * std::max(width, height), width, height));
    database.WriteCameraLens(id, {});
    fisheyes.insert(id);
  }
  UndoVerification(database, CamerasOfImages(database), fisheyes);
  transaction.Commit();
  stage.Add("cameras", fisheyes.size());
  if (!fisheyes.empty()) {
    stage.Warn(ResultWarning{
        std::to_string(fisheyes.size()) + (fisheyes.size() == 1 ? " camera is" : " cameras are") +
            " taken for fisheye lenses (SIMPLE_RADIAL_FISHEYE), which show more than 150 degrees: "
            "the photos bend more than SIMPLE_RADIAL can",
        "if they are not, mask what stays still in the photos; else --camera_model or "
        "--camera_params of the right lens is more accurate"});
  }
  return stage.Finish();
}

}  // namespace cairn
