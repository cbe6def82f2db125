#include "cairn/io/transforms_json.h"

#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "io/bundler_frame.h"

namespace cairn {
namespace {

using Json = nlohmann::ordered_json;

// Intrinsics in the names of nerfstudio's OPENCV model.
void AddIntrinsics(const Camera& camera, Json& frame) {
  frame["w"] = camera.width;
  frame["h"] = camera.height;
  frame["fl_x"] = camera.FocalX();
  frame["fl_y"] = camera.FocalY();
  frame["cx"] = camera.PrincipalPoint().x();
  frame["cy"] = camera.PrincipalPoint().y();
  constexpr const char* kNames[4] = {"k1", "k2", "p1", "p2"};
  const std::vector<int> distortion = camera.DistortionIndices();
  for (size_t i = 0; i < 4; ++i) {
    frame[kNames[i]] = i < distortion.size() ? camera.params[distortion[i]] : 0.0;
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

void WriteTransformsJson(const Reconstruction& reconstruction, const std::string& path,
                         const std::string& image_folder, const std::string& ply_path) {
  Json root;
  root["camera_model"] = "OPENCV";
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
}

}  // namespace cairn
