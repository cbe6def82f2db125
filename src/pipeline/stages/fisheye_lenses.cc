#include "pipeline/stages/fisheye_lenses.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "intrinsics/camera_pairs.h"
#include "intrinsics/known_intrinsics.h"
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
  std::map<camera_t, KnownIntrinsics> known = ReadKnownIntrinsics(database);
  std::erase_if(known, [&](const auto& entry) { return own.count(entry.first) == 0; });
  const auto size_of = [](const KnownIntrinsics& of) {
    return std::pair(of.camera.width, of.camera.height);
  };
  std::set<std::pair<int, int>> sizes;  // of those before, whose photographs others may have joined
  for (const auto& [id, of] : known) {
    if (IsOpen(of, kFisheye)) sizes.insert(size_of(of));
  }
  std::set<camera_t> fisheyes;
  Database::Transaction transaction(database);
  for (const auto& [id, of] : known) {
    if (!IsOpen(of, CameraModel::kSimpleRadial)) continue;
    if (!IsBeyondFold(of) && sizes.count(size_of(of)) == 0) continue;
    const auto [width, height] = size_of(of);
    const double guess = FocalFactor(kFisheye) * std::max(width, height);
    database.WriteCamera(Camera::FromFocal(id, kFisheye, guess, width, height));
    database.WriteCameraLens(id, {});
    fisheyes.insert(id);
  }
  stage.Add("cameras", fisheyes.size());
  if (!fisheyes.empty()) {
    UndoVerification(database, CamerasOfImages(database), fisheyes);
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
