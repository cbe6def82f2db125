// The layout is documented in COLMAP's code only; see third_party_notes/colmap-model-format.md.
#include <cmath>

#include "io/byte_reader.h"
#include "io/colmap_files.h"
#include "io/writers.h"

namespace cairn {
namespace {

constexpr size_t kMinCameraSize = 4 + 4 + 8 + 8 + 2 * 8;  // EQUIRECTANGULAR
constexpr size_t kMinImageSize = 4 + 7 * 8 + 4 + 1 + 8;
constexpr size_t kPoint2DSize = 3 * 8;
constexpr size_t kMinPoint3DSize = 8 + 3 * 8 + 3 + 8 + 8;
constexpr size_t kTrackElementSize = 2 * 4;

Camera ReadBinaryCamera(ByteReader& reader, camera_t id) {
  Camera camera;
  camera.camera_id = id;
  const std::string name = "camera " + std::to_string(id);
  const int32_t model_id = reader.Read<int32_t>();
  const std::optional<CameraModel> model = CameraModelFromId(model_id);
  if (!model) {
    reader.Fail(name + " has the model " + std::to_string(model_id) +
                ", which is none of COLMAP 4's: how many parameters it has is not known");
  }
  camera.model = *model;
  const uint64_t width = reader.Read<uint64_t>();
  const uint64_t height = reader.Read<uint64_t>();
  if (width > INT32_MAX || height > INT32_MAX) reader.Fail(name + " has an impossible size");
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  camera.params.resize(CameraModelNumParams(*model));
  for (double& param : camera.params) param = reader.Read<double>();
  const std::string reason = camera.Validate();
  if (!reason.empty()) reader.Fail(name + ": " + reason);
  return camera;
}

RegisteredImage ReadBinaryImage(ByteReader& reader, image_t id) {
  RegisteredImage image;
  image.image.image_id = id;
  Eigen::Vector4d wxyz;
  auto& [rotation, translation] = image.cam_from_world;
  for (double& value : wxyz) value = reader.Read<double>();
  for (double& value : translation) value = reader.Read<double>();
  rotation = UnitQuaternion(wxyz);
  if (rotation.squaredNorm() == 0 || !translation.allFinite()) {
    reader.Fail("image " + std::to_string(id) + " has an impossible pose");
  }
  image.image.camera_id = reader.Read<uint32_t>();
  image.image.name = reader.ReadCString();
  const size_t num_points = reader.ReadCount(kPoint2DSize);
  image.points2D.resize(num_points);
  image.point3D_ids.resize(num_points);
  for (size_t i = 0; i < num_points; ++i) {
    image.points2D[i].x() = reader.Read<double>();
    image.points2D[i].y() = reader.Read<double>();
    image.point3D_ids[i] = reader.Read<uint64_t>();
    if (!image.points2D[i].allFinite()) {
      reader.Fail("image " + std::to_string(id) + " has a keypoint that is not finite");
    }
  }
  return image;
}

Point3D ReadBinaryPoint(ByteReader& reader, point3D_t id) {
  Point3D point;
  for (double& value : point.xyz) value = reader.Read<double>();
  for (uint8_t& channel : point.color) channel = reader.Read<uint8_t>();
  point.error_px = reader.Read<double>();
  if (!point.xyz.allFinite() || !std::isfinite(point.error_px)) {
    reader.Fail("point " + std::to_string(id) + " is not finite");
  }
  point.track.resize(reader.ReadCount(kTrackElementSize));
  for (TrackElement& element : point.track) {
    element.image_id = reader.Read<uint32_t>();
    element.point2D = reader.Read<uint32_t>();
  }
  return point;
}

// A file of records, each of which begins with its id.
template <class Id, class Value>
void ReadRecords(const std::string& path, const char* kind, size_t min_size,
                 Value (*read)(ByteReader&, Id), std::map<Id, Value>& records) {
  ByteReader reader(path);
  for (size_t n = reader.ReadCount(min_size); n > 0; --n) {
    const Id id = reader.Read<Id>();
    AddNew(reader, kind, id, read(reader, id), records);
  }
  reader.ExpectEnd();
}

void WriteCameras(const Reconstruction& reconstruction, ByteWriter& out) {
  out << uint64_t{reconstruction.cameras.size()};
  for (const auto& [id, camera] : reconstruction.cameras) {
    out << id << static_cast<int32_t>(camera.model) << static_cast<uint64_t>(camera.width)
        << static_cast<uint64_t>(camera.height);
    for (const double param : camera.params) out << param;
  }
}

void WriteImages(const Reconstruction& reconstruction, ByteWriter& out) {
  out << uint64_t{reconstruction.images.size()};
  for (const auto& [id, image] : reconstruction.images) {
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    const Eigen::Vector3d& t = image.cam_from_world.translation;
    out << id << q.w() << q.x() << q.y() << q.z() << t.x() << t.y() << t.z()
        << image.image.camera_id
        << std::string_view(image.image.name.c_str(), image.image.name.size() + 1)
        << uint64_t{image.points2D.size()};
    for (size_t i = 0; i < image.points2D.size(); ++i) {
      out << image.points2D[i].x() << image.points2D[i].y() << image.point3D_ids[i];
    }
  }
}

void WritePoints(const Reconstruction& reconstruction, ByteWriter& out) {
  out << uint64_t{reconstruction.points3D.size()};
  for (const auto& [id, point] : reconstruction.points3D) {
    out << id << point.xyz.x() << point.xyz.y() << point.xyz.z() << point.color[0] << point.color[1]
        << point.color[2] << StoredError(point) << uint64_t{point.track.size()};
    for (const TrackElement& element : point.track) out << element.image_id << element.point2D;
  }
}

}  // namespace

Reconstruction ReadColmapBinary(const std::string& folder) {
  Reconstruction reconstruction;
  ReadRecords(folder + "/cameras.bin", "camera", kMinCameraSize, ReadBinaryCamera,
              reconstruction.cameras);
  ReadRecords(folder + "/images.bin", "image", kMinImageSize, ReadBinaryImage,
              reconstruction.images);
  ReadRecords(folder + "/points3D.bin", "point", kMinPoint3DSize, ReadBinaryPoint,
              reconstruction.points3D);
  return reconstruction;
}

void WriteColmapBinary(const Reconstruction& reconstruction, const std::string& folder) {
  ByteWriter cameras(folder + "/cameras.bin");
  ByteWriter images(folder + "/images.bin");
  ByteWriter points(folder + "/points3D.bin");
  WriteCameras(reconstruction, cameras);
  WriteImages(reconstruction, images);
  WritePoints(reconstruction, points);
  BlockWriter::CommitAll({&cameras, &images, &points});
}

}  // namespace cairn
