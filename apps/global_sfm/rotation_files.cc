#include "global_sfm/rotation_files.h"

#include "cairn/math/so3.h"
#include "io/text_reader.h"
#include "io/writers.h"

namespace cairn {
namespace {

RotationEdge ReadEdge(TextReader& reader) {
  RotationEdge edge;
  edge.image_id1 = reader.Integer<image_t>("first image");
  edge.image_id2 = reader.Integer<image_t>("second image");
  const auto R = reader.Doubles<Eigen::Matrix3d>("number of a rotation");
  if (!reader.AtLineEnd()) {
    edge.weight = reader.Double("weight");
    if (!(edge.weight > 0)) reader.Fail("a weight that is not positive");
    reader.ExpectLineEnd();
  }
  if (edge.image_id1 == edge.image_id2) reader.Fail("an edge from an image to itself");
  const auto rotation = ToRotation(R);
  if (!rotation) reader.Fail("not a rotation matrix");
  edge.cam2_from_cam1 = *rotation;
  return edge;
}

}  // namespace

std::vector<RotationEdge> ReadRelativeRotations(const std::string& path) {
  TextReader reader(path);
  std::vector<RotationEdge> edges;
  while (reader.NextDataLine()) edges.push_back(ReadEdge(reader));
  return edges;
}

void WriteRotations(const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
                    const std::string& path) {
  TextWriter out(path);
  for (const auto& [image_id, rotation] : cam_from_world) {
    const Eigen::Matrix3d R = rotation.toRotationMatrix();
    out << image_id << " " << R.row(0) << " " << R.row(1) << " " << R.row(2) << "\n";
  }
  out.Commit();
}

}  // namespace cairn
