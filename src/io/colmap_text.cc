#include "io/colmap_files.h"
#include "io/text_reader.h"
#include "io/text_writer.h"

namespace cairn {
namespace {

constexpr int64_t kMaxId32 = 0xFFFFFFFF;

Camera ReadCamera(TextReader& reader) {
  Camera camera;
  camera.camera_id = static_cast<camera_t>(reader.Integer("camera id", 0, kMaxId32));
  const std::string_view model_name = reader.Word();
  const std::optional<CameraModel> model = CameraModelFromName(model_name);
  if (!model) {
    reader.Fail("'" + std::string(model_name) + "' is none of COLMAP 4's camera models");
  }
  camera.model = *model;
  camera.width = static_cast<int>(reader.Integer("width", 0, INT32_MAX));
  camera.height = static_cast<int>(reader.Integer("height", 0, INT32_MAX));
  camera.params.resize(CameraModelNumParams(*model));
  for (double& param : camera.params) param = reader.Double("camera parameter");
  reader.ExpectLineEnd();
  const std::string reason = camera.Validate();
  if (!reason.empty()) reader.Fail(reason);
  return camera;
}

// The second line of an image; absent at the end of the file: no keypoints.
void ReadKeypoints(TextReader& reader, RegisteredImage& image) {
  reader.NextLine();
  while (!reader.AtLineEnd()) {
    const double x = reader.Double("keypoint x");
    const double y = reader.Double("keypoint y");
    image.points2D.emplace_back(x, y);
    const int64_t id = reader.Integer("3D point id", -1);
    image.point3D_ids.push_back(id < 0 ? kInvalidPoint3DId : static_cast<point3D_t>(id));
  }
}

RegisteredImage ReadImage(TextReader& reader) {
  RegisteredImage image;
  image.image.image_id = static_cast<image_t>(reader.Integer("image id", 0, kMaxId32));
  double q[4];
  for (double& value : q) value = reader.Double("quaternion");
  image.cam_from_world.rotation = UnitQuaternion(q[0], q[1], q[2], q[3]);
  if (image.cam_from_world.rotation.squaredNorm() == 0) reader.Fail("the quaternion is zero");
  image.cam_from_world.translation = reader.Vector3("translation");
  image.image.camera_id = static_cast<camera_t>(reader.Integer("camera id", 0, kMaxId32));
  image.image.name = std::string(reader.Rest());
  if (image.image.name.empty()) reader.Fail("the line is too short: the name is missing");
  return image;
}

Point3D ReadTextPoint(TextReader& reader) {
  Point3D point;
  point.xyz = reader.Vector3("point");
  for (uint8_t& channel : point.color) {
    channel = static_cast<uint8_t>(reader.Integer("color", 0, 255));
  }
  point.error_px = reader.Double("error");
  while (!reader.AtLineEnd()) {
    const auto image_id = static_cast<image_t>(reader.Integer("image id", 0, kMaxId32));
    const auto point2D = static_cast<point2D_t>(reader.Integer("keypoint index", 0, kMaxId32));
    point.track.push_back({image_id, point2D});
  }
  return point;
}

void ReadTextCameras(const std::string& path, Reconstruction& reconstruction) {
  TextReader reader(path);
  while (reader.NextDataLine()) {
    const Camera camera = ReadCamera(reader);
    if (!reconstruction.cameras.emplace(camera.camera_id, camera).second) {
      reader.Fail("camera " + std::to_string(camera.camera_id) + " appears twice");
    }
  }
}

void ReadTextImages(const std::string& path, Reconstruction& reconstruction) {
  TextReader reader(path);
  while (reader.NextDataLine()) {
    RegisteredImage image = ReadImage(reader);
    const image_t id = image.image.image_id;
    if (reconstruction.images.count(id) > 0) {
      reader.Fail("image " + std::to_string(id) + " appears twice");
    }
    ReadKeypoints(reader, image);
    reconstruction.images.emplace(id, std::move(image));
  }
}

void ReadTextPoints(const std::string& path, Reconstruction& reconstruction) {
  TextReader reader(path);
  while (reader.NextDataLine()) {
    const point3D_t id = reader.Unsigned("3D point id");
    if (!reconstruction.points3D.emplace(id, ReadTextPoint(reader)).second) {
      reader.Fail("point " + std::to_string(id) + " appears twice");
    }
  }
}

void WriteCameras(const Reconstruction& reconstruction, TextWriter& out) {
  out << "# Camera list with one line of data per camera:\n"
         "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
         "# Number of cameras: "
      << reconstruction.cameras.size() << "\n";
  for (const auto& [id, camera] : reconstruction.cameras) {
    out << id << " " << CameraModelName(camera.model) << " " << camera.width << " " << camera.height
        << " ";
    out.Row(camera.params) << "\n";
  }
}

void WriteImages(const Reconstruction& reconstruction, TextWriter& out) {
  const double num_images = static_cast<double>(reconstruction.images.size());
  const double num_observations = static_cast<double>(reconstruction.NumObservations());
  out << "# Image list with two lines of data per image:\n"
         "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
         "#   POINTS2D[] as (X, Y, POINT3D_ID)\n"
         "# Number of images: "
      << reconstruction.images.size()
      << ", mean observations per image: " << (num_images > 0 ? num_observations / num_images : 0.0)
      << "\n";
  for (const auto& [id, image] : reconstruction.images) {
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    out << id << " ";
    out.Row(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z())) << " ";
    out.Row(image.cam_from_world.translation)
        << " " << image.image.camera_id << " " << image.image.name << "\n";
    for (size_t i = 0; i < image.points2D.size(); ++i) {
      out << (i > 0 ? " " : "");
      out.Row(image.points2D[i]) << " ";
      if (image.point3D_ids[i] == kInvalidPoint3DId) {
        out << "-1";
      } else {
        out << image.point3D_ids[i];
      }
    }
    out << "\n";
  }
}

void WritePoints(const Reconstruction& reconstruction, TextWriter& out) {
  out << "# 3D point list with one line of data per point:\n"
         "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
         "# Number of points: "
      << reconstruction.points3D.size()
      << ", mean track length: " << reconstruction.MeanTrackLength() << "\n";
  for (const auto& [id, point] : reconstruction.points3D) {
    out << id << " ";
    out.Row(point.xyz);
    for (const uint8_t channel : point.color) out << " " << static_cast<int>(channel);
    out << " " << StoredError(point);
    for (const TrackElement& element : point.track) {
      out << " " << element.image_id << " " << element.point2D;
    }
    out << "\n";
  }
}

}  // namespace

Reconstruction ReadColmapText(const std::string& folder) {
  Reconstruction reconstruction;
  ReadTextCameras(folder + "/cameras.txt", reconstruction);
  ReadTextImages(folder + "/images.txt", reconstruction);
  ReadTextPoints(folder + "/points3D.txt", reconstruction);
  return reconstruction;
}

void WriteColmapText(const Reconstruction& reconstruction, const std::string& folder) {
  TextWriter cameras(folder + "/cameras.txt");
  TextWriter images(folder + "/images.txt");
  TextWriter points(folder + "/points3D.txt");
  WriteCameras(reconstruction, cameras);
  WriteImages(reconstruction, images);
  WritePoints(reconstruction, points);
  for (TextWriter* file : {&cameras, &images, &points}) file->Flush();
  for (TextWriter* file : {&cameras, &images, &points}) file->Commit();
}

}  // namespace cairn
