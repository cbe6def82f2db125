#include "pipeline/stages/camera_maker.h"

#include <algorithm>
#include <filesystem>
#include <numbers>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {
namespace {

// An equidistant lens that shows 150 degrees across the larger side: between those that fill the
// diagonal with 180 degrees (about 140) and circles of 180 degrees in the smaller side.
constexpr double kFisheyeFocalFactor = 180.0 / 150.0 / std::numbers::pi;

// nullopt: EXIF does not tell the camera.
std::optional<ExifKey> KeyOf(const Photo& photo) {
  const ExifInfo& exif = photo.exif;
  const std::optional<double> focal = photo.given_focal_px ? photo.given_focal_px : exif.focal_px;
  if (exif.camera_make.empty() || exif.camera_model.empty() || !focal) return std::nullopt;
  return ExifKey(exif.camera_make, exif.camera_model, *focal, photo.size.width, photo.size.height);
}

// The size that most photos of each sharing folder have, of equally many the first: its camera's.
std::map<std::string, ImageSize> CommonSizes(const CameraOptions& options,
                                             std::span<const Photo> photos) {
  std::map<std::string, std::vector<std::pair<ImageSize, int>>> counts;
  for (const Photo& photo : photos) {
    const std::optional<std::string> folder = SharingFolder(options, photo.name);
    if (!folder || !photo.error.empty()) continue;
    auto& of_folder = counts[*folder];
    const auto same = std::ranges::find(of_folder, photo.size, &std::pair<ImageSize, int>::first);
    if (same == of_folder.end()) {
      of_folder.emplace_back(photo.size, 1);
    } else {
      ++same->second;
    }
  }
  std::map<std::string, ImageSize> common;
  for (const auto& [folder, sizes] : counts) {
    common[folder] = std::ranges::max_element(sizes, {}, &std::pair<ImageSize, int>::second)->first;
  }
  return common;
}

}  // namespace

double FocalFactor(CameraModel model) {
  return CameraModelIsFisheye(model) ? kFisheyeFocalFactor : kDefaultFocalFactor;
}

PhotoRecord FailedPhoto(const std::string& folder, PhotoRecord photo) {
  try {
    if (HashFile(PathInFolder(folder, photo.name)) != photo.file_hash) photo.file_hash = 0;
  } catch (const IoError&) {
    photo.file_hash = 0;
  }
  return photo;
}

std::map<camera_t, ImageSize> CameraSizes(const Database& database) {
  std::map<camera_t, ImageSize> sizes;
  for (const Camera& camera : database.ReadCameras()) {
    sizes[camera.camera_id] = {camera.width, camera.height};
  }
  for (const UnknownCamera& camera : database.ReadUnknownCameras()) {
    if (camera.width > 0 && camera.height > 0) {
      sizes[camera.camera_id] = {camera.width, camera.height};
    }
  }
  return sizes;
}

void CheckCameraOptions(const CameraOptions& options) {
  if (options.single_camera && options.single_camera_per_folder) {
    throw ConfigError("single_camera_per_folder", "single_camera is given, too");
  }
  if (options.camera_params.empty()) return;
  const auto expected = static_cast<size_t>(CameraModelNumParams(options.camera_model));
  if (options.camera_params.size() == expected) return;
  throw ConfigError("camera_params", std::string(CameraModelName(options.camera_model)) + " has " +
                                         std::to_string(expected) + " parameters, " +
                                         std::to_string(options.camera_params.size()) +
                                         " are given");
}

std::optional<std::string> SharingFolder(const CameraOptions& options,
                                         const std::string& image_name) {
  if (options.single_camera) return "";
  if (options.single_camera_per_folder) {
    return std::filesystem::path(image_name).parent_path().string();
  }
  return std::nullopt;
}

CameraMaker::CameraMaker(const CameraOptions& options, camera_t first_id,
                         std::map<std::string, SharedCamera> shared, std::span<const Photo> photos)
    : options_(options),
      next_id_(first_id),
      shared_(std::move(shared)),
      common_sizes_(CommonSizes(options, photos)) {}

std::optional<camera_t> CameraMaker::CameraOf(Photo& photo) {
  if (const auto folder = SharingFolder(options_, photo.name))
    return CameraOfFolder(*folder, photo);
  const std::optional<ExifKey> key = KeyOf(photo);
  if (!key) return Make(photo).camera_id;
  const auto it = by_exif_.find(*key);
  if (it != by_exif_.end()) return it->second;
  return by_exif_[*key] = Make(photo).camera_id;
}

void CameraMaker::AddKnown(const Photo& photo, camera_t camera_id) {
  if (const std::optional<ExifKey> key = KeyOf(photo)) by_exif_.try_emplace(*key, camera_id);
}

std::optional<camera_t> CameraMaker::CameraOfFolder(const std::string& folder, Photo& photo) {
  const auto shared = shared_.find(folder);
  const ImageSize size = shared != shared_.end() ? shared->second.size : common_sizes_.at(folder);
  if (photo.size == size) {
    if (shared != shared_.end()) return shared->second.camera_id;
    const camera_t camera_id = Make(photo).camera_id;
    shared_[folder] = {camera_id, size};
    return camera_id;
  }
  photo.error = "is " + SizeText(photo.size) + " pixels, the single camera " +
                (folder.empty() ? "" : "of its folder ") + SizeText(size) +
                " (without --single_camera" + (options_.single_camera ? "" : "_per_folder") +
                " it has its own)";
  return std::nullopt;
}

const Camera& CameraMaker::Make(const Photo& photo) {
  const std::optional<double> focal =
      photo.given_focal_px ? photo.given_focal_px : photo.exif.focal_px;
  const bool is_panorama = photo.exif.is_panorama && options_.camera_params.empty();
  const CameraModel model = is_panorama ? CameraModel::kEquirectangular : options_.camera_model;
  const double guess = FocalFactor(model) * std::max(photo.size.width, photo.size.height);
  Camera camera = Camera::FromFocal(next_id_++, model, focal.value_or(guess), photo.size.width,
                                    photo.size.height);
  // A panorama has no focal length to be known.
  camera.has_prior_focal_length = focal.has_value() || camera.FocalIndices().empty();
  if (!options_.camera_params.empty()) {
    camera.params = options_.camera_params;
    camera.has_prior_focal_length = true;
    const std::string reason = camera.Validate();
    if (!reason.empty()) throw ConfigError("camera_params", reason);
  }
  cameras_.push_back(std::move(camera));
  return cameras_.back();
}

}  // namespace cairn
