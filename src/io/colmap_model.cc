#include "cairn/io/colmap_model.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string_view>

#include "base/output_folder.h"
#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/scene/image.h"
#include "io/colmap_files.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

bool HasFile(const std::string& folder, const char* name) {
  std::error_code ignored;
  return fs::is_regular_file(fs::path(folder) / name, ignored);
}

std::string IdText(const char* kind, uint64_t id) {
  return std::string(kind) + " " + std::to_string(id);
}

void CheckNames(const Reconstruction& r, const std::string& folder) {
  std::map<std::string_view, image_t> id_of_name;
  for (const auto& [id, image] : r.images) {
    const auto [other, is_new] = id_of_name.emplace(image.image.name, id);
    if (is_new) continue;
    throw IoError(folder, IdText("image", other->second) + " and " + IdText("image", id) +
                              " have one name, " + image.image.name);
  }
}

void CheckReferences(const Reconstruction& r, const std::string& folder) {
  for (const auto& [id, image] : r.images) {
    if (!r.cameras.contains(image.image.camera_id)) {
      throw IoError(folder, IdText("image", id) + " refers to " +
                                IdText("camera", image.image.camera_id) + ", which is not there");
    }
  }
}

// Of distinct keypoints that refer back, as many as refer to a point.
void CheckTracks(const Reconstruction& r, const std::string& folder) {
  int64_t num_references = 0;
  for (const auto& [id, image] : r.images) num_references += image.NumPoints();
  for (const auto& [id, point] : r.points3D) {
    if (std::ranges::adjacent_find(point.track) != point.track.end()) {
      throw IoError(folder, IdText("point", id) + " refers to a keypoint twice");
    }
    for (const TrackElement& element : point.track) {
      const auto image = r.images.find(element.image_id);
      if (image == r.images.end() || element.point2D >= image->second.point3D_ids.size() ||
          image->second.point3D_ids[element.point2D] != id) {
        throw IoError(
            folder, IdText("point", id) + " refers to " + IdText("keypoint", element.point2D) +
                        " of " + IdText("image", element.image_id) + ", which does not refer back");
      }
    }
  }
  if (num_references != r.NumObservations()) {
    throw IoError(folder, "images refer to points that are not there, or do not refer back");
  }
}

// COLMAP 4.x keeps rigs and frames beside the three files; those of the model that was replaced
// would contradict the new one. Without them 4.x makes its own from cameras and images.
void RemoveRigFiles(const std::string& folder, ColmapModelFormat format) {
  const char* const extension = format == ColmapModelFormat::kBinary ? ".bin" : ".txt";
  for (const char* name : {"rigs", "frames"}) {
    std::error_code ignored;
    fs::remove(fs::path(folder) / (std::string(name) + extension), ignored);
  }
}

}  // namespace

Eigen::Quaterniond UnitQuaternion(const Eigen::Vector4d& wxyz) {
  Eigen::Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  const double squared_norm = q.squaredNorm();
  if (!(squared_norm > 1e-20) || !std::isfinite(squared_norm))
    return Eigen::Quaterniond(0, 0, 0, 0);
  if (std::abs(squared_norm - 1.0) > 1e-14) q.coeffs() /= std::sqrt(squared_norm);
  return q;
}

bool IsColmapModel(const std::string& folder) {
  return HasFile(folder, "cameras.bin") || HasFile(folder, "cameras.txt");
}

Reconstruction ReadColmapModel(const std::string& folder) {
  const bool is_binary = HasFile(folder, "cameras.bin") || !HasFile(folder, "cameras.txt");
  Reconstruction reconstruction = is_binary ? ReadColmapBinary(folder) : ReadColmapText(folder);
  for (auto& [id, point] : reconstruction.points3D) {
    std::sort(point.track.begin(), point.track.end());
  }
  CheckNames(reconstruction, folder);
  CheckReferences(reconstruction, folder);
  CheckTracks(reconstruction, folder);
  return reconstruction;
}

void WriteColmapModel(const Reconstruction& reconstruction, const std::string& folder,
                      ColmapModelFormat format) {
  for (const auto& [id, image] : reconstruction.images) {
    CAIRN_CHECK_EQ(id, image.image.image_id);
    CAIRN_CHECK_EQ(image.points2D.size(), image.point3D_ids.size());
    if (!IsImageName(image.image.name)) {
      throw IoError(folder, "'" + image.image.name + "' cannot be an image's name in a model");
    }
    if (!std::ranges::all_of(image.points2D, [](const auto& p) { return p.allFinite(); })) {
      throw IoError(folder, "a keypoint of " + image.image.name + " is not finite");
    }
    const Rigid3d& pose = image.cam_from_world;
    const Eigen::Quaterniond& q = pose.rotation;
    if (!pose.translation.allFinite() ||
        UnitQuaternion({q.w(), q.x(), q.y(), q.z()}).squaredNorm() == 0) {
      throw IoError(folder, IdText("image", id) + " has an impossible pose");
    }
  }
  for (const auto& [id, point] : reconstruction.points3D) {
    if (!point.xyz.allFinite()) throw IoError(folder, IdText("point", id) + " is not finite");
  }
  for (const auto& [id, camera] : reconstruction.cameras) {
    if (const std::string reason = camera.Validate(); !reason.empty()) {
      throw IoError(folder, IdText("camera", id) + ": " + reason);
    }
  }
  CheckNames(reconstruction, folder);
  CheckReferences(reconstruction, folder);
  CheckTracks(reconstruction, folder);
  if (format == ColmapModelFormat::kText && fs::exists(fs::path(folder) / "cameras.bin")) {
    throw IoError(folder,
                  "has a binary model, which readers take in place of text; give another "
                  "folder");
  }
  CreateFolders(folder);
  if (format == ColmapModelFormat::kBinary) {
    WriteColmapBinary(reconstruction, folder);
  } else {
    WriteColmapText(reconstruction, folder);
  }
  RemoveRigFiles(folder, format);
}

void WriteColmapResult(const Reconstruction& reconstruction, const std::string& folder,
                       const ColmapResult& result, bool overwrites) {
  std::vector<std::string> names;
  for (const char* extension : {".bin", ".txt"}) {
    for (const char* name : {"cameras", "images", "points3D", "rigs", "frames"}) {
      names.push_back(std::string(name) + extension);
    }
  }
  for (const auto& [name, text] : result.texts) names.push_back(name);
  OutputFolder output(folder, result.command, names, overwrites);
  WriteColmapModel(reconstruction, output.staging(), result.format);
  for (const auto& [name, text] : result.texts) {
    WriteFileAtomically(output.staging() + "/" + name, text);
  }
  output.Commit();
}

}  // namespace cairn
