#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/image/bitmap.h"
#include "cairn/image/exif.h"
#include "cairn/pipeline/stages.h"

namespace cairn {

// Focal length over the larger side where nothing is known: COLMAP's.
inline constexpr double kDefaultFocalFactor = 1.2;
// The same for each model.
double FocalFactor(CameraModel model);

// A file of the folder on its way into the database.
struct Photo {
  std::string name;
  std::optional<double> given_focal_px;
  uint64_t file_hash = 0;
  std::string error;  // why it cannot be used
  ImageSize size;
  ExifInfo exif;
  std::optional<Image> image;  // that it becomes
};

// How a photograph with an error is remembered: with its hash, so that it stays out until it
// changes. 0 where it is another file by now or cannot be read for now (gone, no connection), so
// that the next run tries it.
PhotoRecord FailedPhoto(const std::string& folder, PhotoRecord photo);

// The size of the photographs of each camera, those of unknown models included, if they have one.
std::map<camera_t, ImageSize> CameraSizes(const Database& database);

// Throws ConfigError when camera_params do not fit camera_model, or both ways to share are asked
// for.
void CheckCameraOptions(const CameraOptions& options);

// What photographs of one camera have in common: make, model, focal length and size.
using ExifKey = std::tuple<std::string, std::string, double, int, int>;

// What the images have in common that share a camera whatever EXIF says: nothing ("",
// single_camera), or the sub-folder; nullopt: EXIF decides.
std::optional<std::string> SharingFolder(const CameraOptions& options,
                                         const std::string& image_name);

// A camera that photos share.
struct SharedCamera {
  camera_t camera_id = kInvalidCameraId;
  ImageSize size;
};

// Gives photos their cameras, making new ones with ids from first_id on. `shared` are the cameras
// that sharing folders have already; others share one of the size that most of their photos have.
class CameraMaker {
 public:
  CameraMaker(const CameraOptions& options, camera_t first_id,
              std::map<std::string, SharedCamera> shared, std::span<const Photo> photos);

  // A photograph that has this camera, for others to share.
  void AddKnown(const Photo& photo, camera_t camera_id);
  // The camera of the photo; nullopt, with photo.error set, if the shared camera does not fit.
  std::optional<camera_t> CameraOf(Photo& photo);
  const std::vector<Camera>& cameras() const { return cameras_; }

 private:
  std::optional<camera_t> CameraOfFolder(const std::string& folder, Photo& photo);
  const Camera& Make(const Photo& photo);

  const CameraOptions options_;
  camera_t next_id_;
  std::map<std::string, SharedCamera> shared_;
  const std::map<std::string, ImageSize> common_sizes_;
  std::map<ExifKey, camera_t> by_exif_;
  std::vector<Camera> cameras_;
};

}  // namespace cairn
