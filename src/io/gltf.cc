#include "cairn/io/gltf.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/bundler_frame.h"
#include "io/drawing.h"
#include "io/writers.h"

namespace cairn {
namespace {

using Json = nlohmann::ordered_json;

// Numbers that glTF 2.0 gives to kinds of values, of primitives, of buffers, and of chunks.
constexpr int kUnsignedByte = 5121, kUnsignedInt = 5125, kFloat = 5126;
constexpr int kPoints = 0, kLines = 1;
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr uint32_t kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942;

// In the order of the file: positions, colors, and the edges' vertices, counted from the first of
// a camera.
std::string Buffer(const Drawing& drawing) {
  std::string bytes;
  const auto add = [&bytes](const auto& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  for (const Drawing::Vertex& vertex : drawing.vertices) {
    for (int i = 0; i < 3; ++i) add(static_cast<float>(vertex.xyz[i]));
  }
  for (const Drawing::Vertex& vertex : drawing.vertices) {
    for (const uint8_t channel : vertex.color) add(channel);
    add(uint8_t{255});
  }
  const auto first = static_cast<uint32_t>(drawing.num_points);
  for (const auto& [vertex1, vertex2] : drawing.edges) {
    add(static_cast<uint32_t>(vertex1) - first);
    add(static_cast<uint32_t>(vertex2) - first);
  }
  return bytes;
}

class GltfScene {
 public:
  explicit GltfScene(const Drawing& drawing) : drawing_(drawing) {
    root_["asset"] = {{"version", "2.0"}, {"generator", "cairn"}};
    root_["scene"] = 0;
    root_["scenes"] = Json::array({Json::object()});
    if (drawing.vertices.empty()) return;
    const size_t n = drawing.vertices.size();
    AddVertexView(n, 12);
    AddVertexView(n, 4);
    if (!drawing.edges.empty()) AddView(8 * drawing.edges.size(), kElementArrayBuffer);
    root_["buffers"] = Json::array({Json{{"byteLength", view_end_}}});
    if (drawing.num_points > 0) AddMesh("points", kPoints, 0, drawing.num_points);
    if (drawing.num_points < n) AddMesh("frusta", kLines, drawing.num_points, n);
  }

  void AddCamera(const RegisteredImage& image, const Camera& camera) {
    const Rigid3d world_from_cam = Inverse(image.cam_from_world);
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topLeftCorner<3, 3>() = world_from_cam.RotationMatrix() * FlipYZ();
    matrix.topRightCorner<3, 1>() = world_from_cam.translation;
    Json node{{"name", image.image.name},
              {"matrix", std::vector<double>(matrix.data(), matrix.data() + 16)}};
    if (camera.model != CameraModel::kEquirectangular && camera.width > 0 && camera.height > 0) {
      const auto [known, is_new] =
          camera_index_.try_emplace(camera.camera_id, camera_index_.size());
      if (is_new) root_["cameras"].push_back(Lens(camera));
      node["camera"] = known->second;
    }
    AddNode(std::move(node));
  }

  std::string Text() const { return root_.dump(-1, ' ', false, Json::error_handler_t::replace); }

 private:
  void AddView(size_t num_bytes, int target) {
    root_["bufferViews"].push_back(Json{
        {"buffer", 0}, {"byteOffset", view_end_}, {"byteLength", num_bytes}, {"target", target}});
    view_end_ += num_bytes;
  }

  // Points and frusta share a view, so that its stride has to be told.
  void AddVertexView(size_t num_vertices, size_t stride) {
    AddView(num_vertices * stride, kArrayBuffer);
    root_["bufferViews"].back()["byteStride"] = stride;
  }

  int AddAccessor(int view, size_t offset, int kind, size_t count, const char* type) {
    root_["accessors"].push_back(Json{{"bufferView", view},
                                      {"byteOffset", offset},
                                      {"componentType", kind},
                                      {"count", count},
                                      {"type", type}});
    return static_cast<int>(root_["accessors"].size()) - 1;
  }

  void AddMesh(const char* name, int mode, size_t begin, size_t end) {
    Eigen::Vector3f low = drawing_.vertices[begin].xyz.cast<float>(), high = low;
    for (size_t i = begin; i < end; ++i) {
      low = low.cwiseMin(drawing_.vertices[i].xyz.cast<float>());
      high = high.cwiseMax(drawing_.vertices[i].xyz.cast<float>());
    }
    const int positions = AddAccessor(0, 12 * begin, kFloat, end - begin, "VEC3");
    root_["accessors"][positions]["min"] = {low.x(), low.y(), low.z()};
    root_["accessors"][positions]["max"] = {high.x(), high.y(), high.z()};
    const int colors = AddAccessor(1, 4 * begin, kUnsignedByte, end - begin, "VEC4");
    root_["accessors"][colors]["normalized"] = true;
    Json primitive{{"mode", mode}, {"attributes", {{"POSITION", positions}, {"COLOR_0", colors}}}};
    if (mode == kLines) {
      primitive["indices"] = AddAccessor(2, 0, kUnsignedInt, 2 * drawing_.edges.size(), "SCALAR");
    }
    root_["meshes"].push_back(Json{{"name", name}, {"primitives", Json::array({primitive})}});
    AddNode(Json{{"name", name}, {"mesh", root_["meshes"].size() - 1}});
  }

  Json Lens(const Camera& camera) const {
    const double half_width = 0.5 * camera.width / camera.FocalX();
    const double half_height = 0.5 * camera.height / camera.FocalY();
    return Json{{"type", "perspective"},
                {"perspective",
                 {{"yfov", 2 * std::atan(half_height)},
                  {"aspectRatio", half_width / half_height},
                  {"znear", 0.01 * drawing_.frustum_depth}}}};
  }

  void AddNode(Json node) {
    root_["scenes"][0]["nodes"].push_back(root_["nodes"].size());
    root_["nodes"].push_back(std::move(node));
  }

  const Drawing& drawing_;
  Json root_;
  size_t view_end_ = 0;
  std::map<camera_t, size_t> camera_index_;
};

}  // namespace

void WriteGltf(const Reconstruction& reconstruction, const std::string& path) {
  const Drawing drawing = Draw(reconstruction, {});
  GltfScene scene(drawing);
  for (const auto& [id, image] : reconstruction.images) {
    scene.AddCamera(image, reconstruction.CameraOf(image));
  }
  std::string text = scene.Text();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::string buffer = Buffer(drawing);  // whole words
  const size_t bin_size = buffer.empty() ? 0 : 8 + buffer.size();
  ByteWriter out(path);
  out << "glTF" << uint32_t{2} << static_cast<uint32_t>(20 + text.size() + bin_size);
  out << static_cast<uint32_t>(text.size()) << kJsonChunk << text;
  if (!buffer.empty()) out << static_cast<uint32_t>(buffer.size()) << kBinChunk << buffer;
  out.Commit();
}

}  // namespace cairn
