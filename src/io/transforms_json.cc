#include "cairn/io/transforms_json.h"

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <string_view>

#include "cairn/base/file.h"
#include "io/bundler_frame.h"

namespace cairn {
namespace {

using Json = nlohmann::ordered_json;

// nerfstudio's name of the model that holds the camera best: one a file.
std::string_view ModelOf(const Camera& camera) {
  if (camera.model == CameraModel::kEquirectangular) return "EQUIRECTANGULAR";
  return CameraModelIsFisheye(camera.model) ? "OPENCV_FISHEYE" : "OPENCV";
}

// Does that model hold all that the camera has?
bool IsHeld(const Camera& camera) {
  switch (camera.model) {
    case CameraModel::kFullOpenCV:
    case CameraModel::kThinPrismFisheye:
    case CameraModel::kRadTanThinPrismFisheye:
    case CameraModel::kFov:
    case CameraModel::kSimpleDivision:
    case CameraModel::kDivision:
    case CameraModel::kEucm:
      return false;
    default:
      return true;
  }
}

// Names what the file cannot hold.
std::vector<std::string> Approximations(const Reconstruction& reconstruction,
                                        std::string_view model) {
  std::map<CameraModel, int> lost, other;
  for (const auto& [id, camera] : reconstruction.cameras) {
    if (ModelOf(camera) != model) {
      ++other[camera.model];
    } else if (!IsHeld(camera)) {
      ++lost[camera.model];
    }
  }
  std::vector<std::string> warnings;
  const auto warn = [&warnings](const std::map<CameraModel, int>& counts, const std::string& what) {
    for (const auto& [camera_model, count] : counts) {
      warnings.push_back("nerfstudio: " + std::to_string(count) + " cameras are of the model " +
                         std::string(CameraModelName(camera_model)) + what);
    }
  };
  warn(lost,
       ", which the format does not have: their distortion is left out. Images and model of "
       "global_sfm undistort have none");
  warn(other,
       ", but a file holds one model, here " + std::string(model) + ": their rays are wrong there");
  const auto num_no_text = std::ranges::count_if(reconstruction.images, [](const auto& entry) {
    return Json(entry.second.image.name).dump(-1, ' ', false, Json::error_handler_t::ignore) !=
           Json(entry.second.image.name).dump(-1, ' ', false, Json::error_handler_t::replace);
  });
  if (num_no_text > 0) {
    warnings.push_back("nerfstudio: " + std::to_string(num_no_text) +
                       " image names are no UTF-8, which JSON cannot hold: their photographs will "
                       "not be found");
  }
  return warnings;
}

// Intrinsics in the names of nerfstudio's OPENCV and OPENCV_FISHEYE models.
void AddIntrinsics(const Camera& camera, Json& frame) {
  const bool is_panorama = camera.model == CameraModel::kEquirectangular;
  frame["w"] = camera.width;
  frame["h"] = camera.height;
  // Of panoramas nerfstudio wants half the width and the height: pixels for pi of either angle.
  frame["fl_x"] = is_panorama ? 0.5 * camera.width : camera.FocalX();
  frame["fl_y"] = is_panorama ? camera.height : camera.FocalY();
  frame["cx"] = camera.PrincipalPoint().x();
  frame["cy"] = camera.PrincipalPoint().y();
  if (is_panorama) return;
  const bool is_fisheye = CameraModelIsFisheye(camera.model);
  const std::array<const char*, 4> names =
      is_fisheye ? std::array{"k1", "k2", "k3", "k4"} : std::array{"k1", "k2", "p1", "p2"};
  std::vector<int> distortion = camera.DistortionIndices();
  if (!IsHeld(camera)) distortion.clear();
  for (size_t i = 0; i < 4; ++i) {
    frame[names[i]] = i < distortion.size() ? camera.params[distortion[i]] : 0.0;
  }
}

Json TransformMatrix(const Rigid3d& cam_from_world) {
  const Rigid3d world_from_cam = Inverse(cam_from_world);
  const Eigen::Matrix3d R = world_from_cam.RotationMatrix() * FlipYZ();
  Json matrix = Json::array();
  for (int row = 0; row < 3; ++row) {
    matrix.push_back({R(row, 0), R(row, 1), R(row, 2), world_from_cam.translation[row]});
  }
  matrix.push_back({0.0, 0.0, 0.0, 1.0});
  return matrix;
}

}  // namespace

std::vector<std::string> WriteTransformsJson(const Reconstruction& reconstruction,
                                             const std::string& path,
                                             const std::string& image_folder,
                                             const std::string& ply_path) {
  Json root;
  const std::string_view model =
      reconstruction.images.empty()
          ? "OPENCV"
          : ModelOf(reconstruction.CameraOf(reconstruction.images.begin()->second));
  root["camera_model"] = model;
  // From the model's world to the file's: the same.
  root["applied_transform"] =
      Json{{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}};
  if (!ply_path.empty()) root["ply_file_path"] = ply_path;
  root["frames"] = Json::array();
  for (const auto& [id, image] : reconstruction.images) {
    Json frame;
    frame["file_path"] =
        image_folder.empty() ? image.image.name : image_folder + "/" + image.image.name;
    AddIntrinsics(reconstruction.CameraOf(image), frame);
    frame["transform_matrix"] = TransformMatrix(image.cam_from_world);
    root["frames"].push_back(std::move(frame));
  }
  WriteFileAtomically(path, root.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  return Approximations(reconstruction, model);
}

}  // namespace cairn
