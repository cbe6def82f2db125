#include "cairn/io/strecha.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "cairn/base/error.h"
#include "io/bundler_frame.h"
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

Eigen::Matrix3d ReadMatrix(TextReader& reader, std::string_view what) {
  Eigen::Matrix3d m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = reader.DoubleOnAnyLine(what);
  return m;
}

// 0, which Camera::Validate refuses, for what cannot be a size.
int ToSize(double value) { return value >= 1 && value < 1e9 ? static_cast<int>(value) : 0; }

void ReadCameraFile(const std::string& path, Camera& camera, Rigid3d& cam_from_world) {
  TextReader reader(path);
  const Eigen::Matrix3d K = ReadMatrix(reader, "calibration matrix");
  for (int i = 0; i < 3; ++i) reader.DoubleOnAnyLine("distortion");
  const Eigen::Matrix3d world_from_cam = ReadMatrix(reader, "rotation");
  Eigen::Vector3d center;
  for (int i = 0; i < 3; ++i) center[i] = reader.DoubleOnAnyLine("camera center");
  camera.width = ToSize(reader.DoubleOnAnyLine("width"));
  camera.height = ToSize(reader.DoubleOnAnyLine("height"));

  if (!IsNearRotation(world_from_cam)) throw IoError(path, "its matrix is not a rotation");
  const Eigen::Quaterniond R = ToRotation(world_from_cam.transpose());
  cam_from_world = Rigid3d(R, R * -center);
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
