#include "pipeline/stages/fisheye_lenses.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "intrinsics/camera_pairs.h"
#include "intrinsics/known_intrinsics.h"
#include "intrinsics/wide_focals.h"
#include "pipeline/stages/camera_maker.h"
#include "report/stage.h"

namespace cairn {
namespace {

// k r_d^2 where the distorted radius r_d = r (1 + k r^2) is largest.
constexpr double kFold = -4.0 / 27;
constexpr CameraModel kFisheye = CameraModel::kSimpleRadialFisheye;
constexpr double kBeyondDoubt = 3;  // standard deviations

bool IsOpen(const KnownIntrinsics& known, CameraModel model) {
  return known.camera.model == model && !known.camera.has_prior_focal_length && !known.is_given;
}

bool IsBeyondFold(const KnownIntrinsics& known) {
  if (!known.lens) return false;
  const double corner = 0.5 * known.camera.DiagonalPx() / known.camera.MeanFocal();
  return (known.lens->k + kBeyondDoubt * known.lens->k_sigma) * corner * corner < kFold;
}

Camera FisheyeInPlaceOf(const Camera& camera) {
  const double guess = FocalFactor(kFisheye) * std::max(camera.width, camera.height);
  return Camera::FromFocal(camera.camera_id, kFisheye, guess, camera.width, camera.height);
}

// The cameras of photographs that we imported.
std::set<camera_t> OwnCameras(const Database& database) {
  std::set<std::string> names;
  for (const PhotoRecord& photo : database.ReadPhotos()) names.insert(photo.name);
  std::set<camera_t> cameras;
  for (const Image& image : database.ReadImages()) {
    if (names.contains(image.name)) cameras.insert(image.camera_id);
  }
  return cameras;
}

}  // namespace

StageReport TakeFisheyes(Database& database, const TwoViewOptions& options, const RunContext& run) {
  Stage stage(run.monitor, "fisheye_lenses");
  const std::set<camera_t> own = OwnCameras(database);
  std::map<camera_t, KnownIntrinsics> known = ReadKnownIntrinsics(database);
  std::erase_if(known, [&](const auto& entry) { return !own.contains(entry.first); });
  using Size = std::pair<int, int>;
  std::set<Size> sizes;  // of those before, whose photographs others may have joined
  std::map<Size, std::map<camera_t, Camera>> open, beyond_fold;
  for (const auto& [id, of] : known) {
    const Size size(of.camera.width, of.camera.height);
    if (IsOpen(of, kFisheye)) sizes.insert(size);
    if (!IsOpen(of, CameraModel::kSimpleRadial)) continue;
    const Camera fisheye = FisheyeInPlaceOf(of.camera);
    open[size].emplace(id, fisheye);
    if (IsBeyondFold(of)) beyond_fold[size].emplace(id, fisheye);
  }
  std::map<camera_t, Camera> fisheyes;
  for (const Size& size : sizes) fisheyes.merge(open[size]);
  // (A lens that bends more than SIMPLE_RADIAL, but like RADIAL, is no fisheye.)
  for (auto& [size, cameras] : beyond_fold) {
    if (HasMoreSupport(database, cameras, options, run)) fisheyes.merge(cameras);
  }
  Database::Transaction transaction(database);
  for (const auto& [id, camera] : fisheyes) {
    database.WriteCamera(camera);
    database.WriteCameraLens(id, {});
  }
  stage.Add("cameras", fisheyes.size());
  if (!fisheyes.empty()) {
    std::set<camera_t> changed;
    for (const auto& [id, camera] : fisheyes) changed.insert(id);
    UndoVerification(database, CamerasOfImages(database), changed);
    transaction.Commit();
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
