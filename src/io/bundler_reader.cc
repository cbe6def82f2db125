#include <algorithm>
#include <utility>

#include "cairn/base/error.h"
#include "cairn/io/bundler.h"
#include "cairn/math/so3.h"
#include "io/bundler_frame.h"
#include "io/text_reader.h"

namespace cairn {
namespace {

// One entry of a point's view list, pixel in our orientation (y down).
struct View {
  int64_t camera = 0;
  int64_t key = 0;
  Eigen::Vector2d pixel;
};

void ReadCamera(TextReader& reader, image_t id, const std::string& name,
                Reconstruction& reconstruction) {
  const auto intrinsics = reader.DoublesOnAnyLine<Eigen::Vector3d>("focal length or distortion");
  const auto R = reader.DoublesOnAnyLine<Eigen::Matrix3d>("rotation");
  const auto t = reader.DoublesOnAnyLine<Eigen::Vector3d>("translation");
  if (intrinsics[0] <= 0 || R.isZero(0.0)) return;  // not registered
  const auto rotation = ToRotation(FlipYZ() * R);
  if (!rotation) reader.Fail("the camera's matrix is not a rotation");

  Camera& camera = reconstruction.cameras[id];
  camera.camera_id = id;
  camera.model = CameraModel::kRadial;
  camera.params = {intrinsics[0], 0.0, 0.0, intrinsics[1], intrinsics[2]};
  RegisteredImage& image = reconstruction.images[id];
  image.image = {id, name, id};
  image.cam_from_world = Rigid3d(*rotation, FlipYZ() * t);
}

// `n`, then per view `camera key x y`, or `camera key` where pixels were left out.
std::vector<View> ReadViews(TextReader& reader, size_t num_cameras) {
  reader.ExpectDataLine("the view list");
  const int64_t num_views = reader.Integer("number of views", 0);
  const int64_t num_words = static_cast<int64_t>(reader.RemainingWords().size());
  if (num_words / 4 == num_views && num_words % 4 == 0) {
    std::vector<View> views(num_views);
    for (View& view : views) {
      view.camera = reader.Integer("camera", 0, static_cast<int64_t>(num_cameras) - 1);
      view.key = reader.Integer("key", 0);
      view.pixel.x() = reader.Double("x");
      view.pixel.y() = -reader.Double("y");
    }
    return views;
  }
  if (num_words / 2 == num_views && num_words % 2 == 0) return {};
  reader.Fail("a view list of " + std::to_string(num_views) + " views has " +
              std::to_string(num_words) + " numbers");
}

Point3D ReadPoint(TextReader& reader) {
  Point3D point;
  point.xyz = reader.DoublesOnAnyLine<Eigen::Vector3d>("point");
  for (uint8_t& channel : point.color) {
    channel = static_cast<uint8_t>(std::clamp(reader.DoubleOnAnyLine("color"), 0.0, 255.0));
  }
  return point;
}

// Turns the views into keypoints, in each image in the order of Bundler's keys.
void AddObservations(const std::vector<std::vector<View>>& views, Reconstruction& reconstruction) {
  std::vector<std::pair<size_t, View>> order;  // with the points' indices
  for (size_t point = 0; point < views.size(); ++point) {
    for (const View& view : views[point]) order.emplace_back(point, view);
  }
  std::ranges::stable_sort(order, {}, [](const std::pair<size_t, View>& entry) {
    return std::pair(entry.second.camera, entry.second.key);
  });
  for (const auto& [point, view] : order) {
    const image_t image_id = static_cast<image_t>(view.camera + 1);
    RegisteredImage& image = reconstruction.images.at(image_id);
    const point2D_t index = static_cast<point2D_t>(image.points2D.size());
    image.points2D.push_back(view.pixel);
    image.point3D_ids.push_back(point + 1);
    reconstruction.points3D.at(point + 1).track.push_back({image_id, index});
  }
}

void ReadPoints(TextReader& reader, int64_t num_points, size_t num_cameras,
                Reconstruction& reconstruction) {
  std::vector<std::vector<View>> views;
  for (int64_t i = 0; i < num_points; ++i) {
    reconstruction.points3D.emplace(i + 1, ReadPoint(reader));
    views.push_back(ReadViews(reader, num_cameras));
    for (const View& view : views.back()) {
      if (!reconstruction.images.contains(static_cast<image_t>(view.camera + 1))) {
        reader.Fail("the point is seen by camera " + std::to_string(view.camera) +
                    ", which is not registered");
      }
    }
  }
  AddObservations(views, reconstruction);
}

}  // namespace

std::vector<BundlerListEntry> ReadBundlerList(const std::string& path) {
  TextReader reader(path);
  std::vector<BundlerListEntry> entries;
  while (reader.NextLine()) {
    const std::vector<std::string_view> words = reader.RemainingWords();
    const std::string_view line = reader.Rest();
    if (words.empty()) {
      if (reader.NextDataLine()) reader.Fail("an image follows after an empty line");
      break;
    }
    BundlerListEntry entry{std::string(line), std::nullopt};
    const size_t n = words.size();
    const std::optional<double> focal_px =
        n < 3 ? std::nullopt : TextReader::ToDouble(words[n - 1]);
    if (focal_px && words[n - 2] == "0") {
      if (*focal_px > 0) entry.focal_px = focal_px;
      const std::string_view name = line.substr(0, words[n - 2].data() - line.data());
      entry.name = std::string(Trimmed(name));
    }
    entries.push_back(std::move(entry));
  }
  return entries;
}

Reconstruction ReadBundler(const std::string& bundle_path, const std::string& list_path,
                           const BundlerReadOptions& options) {
  const std::vector<BundlerListEntry> list = ReadBundlerList(list_path);
  TextReader reader(bundle_path);
  reader.ExpectDataLine("the number of cameras");
  const int64_t num_cameras = reader.Integer("number of cameras", 0);
  const int64_t num_points = reader.Integer("number of points", 0);
  reader.ExpectLineEnd();
  if (num_cameras != static_cast<int64_t>(list.size())) {
    reader.Fail(std::to_string(num_cameras) + " cameras, but " + list_path + " lists " +
                std::to_string(list.size()) + " images");
  }
  Reconstruction reconstruction;
  for (size_t i = 0; i < list.size(); ++i) {
    ReadCamera(reader, static_cast<image_t>(i + 1), list[i].name, reconstruction);
  }
  if (options.read_points) ReadPoints(reader, num_points, list.size(), reconstruction);
  return reconstruction;
}

}  // namespace cairn
