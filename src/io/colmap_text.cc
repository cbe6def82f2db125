#include "io/colmap_files.h"
#include "io/text_reader.h"
#include "io/writers.h"

namespace cairn {
namespace {

Camera ReadTextCamera(TextReader& reader, camera_t id) {
  Camera camera;
  camera.camera_id = id;
  const std::string_view model_name = reader.Word();
  const std::optional<CameraModel> model = CameraModelFromName(model_name);
  if (!model) {
    reader.Fail("'" + std::string(model_name) + "' is none of COLMAP 4's camera models");
  }
  camera.model = *model;
  camera.width = reader.Integer<int>("width", 0);
  camera.height = reader.Integer<int>("height", 0);
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

RegisteredImage ReadTextImage(TextReader& reader, image_t id) {
  RegisteredImage image;
  image.image.image_id = id;
  image.cam_from_world.rotation = UnitQuaternion(reader.Doubles<Eigen::Vector4d>("quaternion"));
  if (image.cam_from_world.rotation.squaredNorm() == 0) reader.Fail("the quaternion is zero");
  image.cam_from_world.translation = reader.Doubles<Eigen::Vector3d>("translation");
  image.image.camera_id = reader.Integer<camera_t>("camera id");
  image.image.name = std::string(reader.Rest());
  if (image.image.name.empty()) reader.Fail("the line is too short: the name is missing");
  return image;
}

Point3D ReadTextPoint(TextReader& reader) {
  Point3D point;
  point.xyz = reader.Doubles<Eigen::Vector3d>("point");
  for (uint8_t& channel : point.color) channel = reader.Integer<uint8_t>("color");
  point.error_px = reader.Double("error");
  while (!reader.AtLineEnd()) {
    TrackElement& element = point.track.emplace_back();
    element.image_id = reader.Integer<image_t>("image id");
    element.point2D = reader.Integer<point2D_t>("keypoint index");
  }
  return point;
}

void WriteCameras(const Reconstruction& reconstruction, TextWriter& out) {
  out << "# Camera list with one line of data per camera:\n"
         "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
         "# Number of cameras: "
      << reconstruction.cameras.size() << "\n";
  for (const auto& [id, camera] : reconstruction.cameras) {
    out << id << " " << CameraModelName(camera.model) << " " << camera.width << " " << camera.height
        << " " << camera.params << "\n";
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
    out << id << " " << Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()) << " "
        << image.cam_from_world.translation << " " << image.image.camera_id << " "
        << image.image.name << "\n";
    for (size_t i = 0; i < image.points2D.size(); ++i) {
      out << (i > 0 ? " " : "") << image.points2D[i] << " ";
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
    out << id << " " << point.xyz << " " << point.color << " " << StoredError(point);
    for (const TrackElement& element : point.track) {
      out << " " << element.image_id << " " << element.point2D;
    }
    out << "\n";
  }
}

}  // namespace

Reconstruction ReadColmapText(const std::string& folder) {
  Reconstruction reconstruction;
  for (TextReader reader(folder + "/cameras.txt"); reader.NextDataLine();) {
    const auto id = reader.Integer<camera_t>("camera id");
    AddNew(reader, "camera", id, ReadTextCamera(reader, id), reconstruction.cameras);
  }
  for (TextReader reader(folder + "/images.txt"); reader.NextDataLine();) {
    const auto id = reader.Integer<image_t>("image id");
    ReadKeypoints(reader,
                  AddNew(reader, "image", id, ReadTextImage(reader, id), reconstruction.images));
  }
  for (TextReader reader(folder + "/points3D.txt"); reader.NextDataLine();) {
    const auto id = static_cast<point3D_t>(reader.Integer("3D point id", 0));
    AddNew(reader, "point", id, ReadTextPoint(reader), reconstruction.points3D);
  }
  return reconstruction;
}

void WriteColmapText(const Reconstruction& reconstruction, const std::string& folder) {
  TextWriter cameras(folder + "/cameras.txt");
  TextWriter images(folder + "/images.txt");
  TextWriter points(folder + "/points3D.txt");
  WriteCameras(reconstruction, cameras);
  WriteImages(reconstruction, images);
  WritePoints(reconstruction, points);
  BlockWriter::CommitAll({&cameras, &images, &points});
}

}  // namespace cairn
