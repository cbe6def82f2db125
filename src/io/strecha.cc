#include "cairn/io/strecha.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "cairn/base/error.h"
#include "cairn/math/so3.h"
#include "io/text_reader.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kExtension = ".camera";

std::vector<std::string> ListCameraFiles(const std::string& folder) {
  std::error_code error;
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(kExtension) && name.size() > kExtension.size()) names.push_back(name);
  }
  if (error) throw IoError(folder, error.message());
  std::sort(names.begin(), names.end());
  return names;
}

// 0, which Camera::Validate refuses, for what cannot be a size.
int ToSize(double value) { return value >= 1 && value < 1e9 ? static_cast<int>(value) : 0; }

void ReadCameraFile(const std::string& path, Camera& camera, Rigid3d& cam_from_world) {
  TextReader reader(path);
  const auto K = reader.DoublesOnAnyLine<Eigen::Matrix3d>("calibration matrix");
  reader.DoublesOnAnyLine<Eigen::Vector3d>("distortion");
  const auto world_from_cam = reader.DoublesOnAnyLine<Eigen::Matrix3d>("rotation");
  const auto center = reader.DoublesOnAnyLine<Eigen::Vector3d>("camera center");
  camera.width = ToSize(reader.DoubleOnAnyLine("width"));
  camera.height = ToSize(reader.DoubleOnAnyLine("height"));

  const auto R = ToRotation(world_from_cam.transpose());
  if (!R) throw IoError(path, "its matrix is not a rotation");
  cam_from_world = Rigid3d(*R, *R * -center);
  camera.model = CameraModel::kPinhole;
  camera.params = {K(0, 0), K(1, 1), K(0, 2) + 0.5, K(1, 2) + 0.5};
  camera.has_prior_focal_length = true;
  const std::string reason = camera.Validate();
  if (!reason.empty()) throw IoError(path, reason);
}

}  // namespace

bool IsStrechaFolder(const std::string& folder) {
  std::error_code ignored;
  return fs::is_directory(folder, ignored) && !ListCameraFiles(folder).empty();
}

Reconstruction ReadStrecha(const std::string& folder) {
  Reconstruction reconstruction;
  image_t id = 0;
  for (const std::string& file : ListCameraFiles(folder)) {
    ++id;
    Camera& camera = reconstruction.cameras[id];
    RegisteredImage& image = reconstruction.images[id];
    camera.camera_id = id;
    image.image = {id, file.substr(0, file.size() - kExtension.size()), id};
    ReadCameraFile(folder + "/" + file, camera, image.cam_from_world);
  }
  if (id == 0) throw IoError(folder, "holds no .camera files");
  return reconstruction;
}

}  // namespace cairn
