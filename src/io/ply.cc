#include "cairn/io/ply.h"

#include "io/drawing.h"
#include "io/writers.h"

namespace cairn {
namespace {

std::string Header(size_t num_vertices, size_t num_edges) {
  std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment written by cairn\nelement vertex " +
      std::to_string(num_vertices) +
      "\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (num_edges > 0) {
    header += "element edge " + std::to_string(num_edges) +
              "\nproperty int vertex1\nproperty int vertex2\n"
              "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  }
  return header + "end_header\n";
}

}  // namespace

void WritePly(const Reconstruction& reconstruction, const std::string& path,
              const PlyOptions& options) {
  const Drawing drawing = Draw(reconstruction, options);
  ByteWriter out(path);
  out << Header(drawing.vertices.size(), drawing.edges.size());
  for (const Drawing::Vertex& vertex : drawing.vertices) {
    for (int i = 0; i < 3; ++i) out << static_cast<float>(vertex.xyz[i]);
    for (const uint8_t channel : vertex.color) out << channel;
  }
  for (const auto& [vertex1, vertex2] : drawing.edges) {
    out << int32_t{vertex1} << int32_t{vertex2};
    for (const uint8_t channel : kFrustumColor) out << channel;
  }
  out.Commit();
}

}  // namespace cairn
