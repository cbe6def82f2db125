#include "cairn/io/one_dsfm.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "cairn/base/error.h"
#include "cairn/math/so3.h"
#include "io/bundler_frame.h"
#include "io/text_reader.h"

namespace cairn {
namespace {

int ReadIndex(TextReader& reader, std::string_view what, int num_images) {
  const int64_t index = reader.Integer(what);
  if (index < 0 || index >= num_images) {
    reader.Fail(std::string(what) + " " + std::to_string(index) +
                " is not in list.txt, which has " + std::to_string(num_images) + " images");
  }
  return static_cast<int>(index);
}

OneDsfmEdge ReadEdge(TextReader& reader, int num_images) {
  OneDsfmEdge edge;
  edge.i = ReadIndex(reader, "image index", num_images);
  edge.j = ReadIndex(reader, "image index", num_images);
  if (edge.i == edge.j) reader.Fail("an edge from image " + std::to_string(edge.i) + " to itself");
  const auto R = reader.Doubles<Eigen::Matrix3d>("rotation");
  const auto t = reader.Doubles<Eigen::Vector3d>("direction");
  reader.ExpectLineEnd();
  // src/io/FORMATS.md, "1DSfM": R = R_i R_j^T and t, the direction of j's center, in i's Bundler
  // frame.
  const auto cam_j_from_cam_i = ToRotation(FlipYZ() * R.transpose() * FlipYZ());
  if (!cam_j_from_cam_i) reader.Fail("the matrix is not a rotation");
  if (t.norm() < 1e-9) reader.Fail("the direction is zero");
  const Eigen::Vector3d center_j_in_cam_i = FlipYZ() * t.normalized();
  edge.cam_j_from_cam_i = Rigid3d(*cam_j_from_cam_i, *cam_j_from_cam_i * -center_j_in_cam_i);
  return edge;
}

// A list that any program may have written can have blanks in a name; here that is a broken line.
void CheckNames(const std::vector<BundlerListEntry>& images, const std::string& path) {
  for (size_t i = 0; i < images.size(); ++i) {
    if (images[i].name.find_first_of(" \t") == std::string::npos) continue;
    throw IoError(path + ":" + std::to_string(i + 1),
                  "'<name>' or '<name> 0 <focal length>' expected, not '" + images[i].name + "'");
  }
}

std::string PathIfPresent(const std::string& folder, const char* name) {
  std::error_code ignored;
  const std::string path = folder + "/" + name;
  return std::filesystem::exists(path, ignored) ? path : "";
}

}  // namespace

std::vector<int> ReadOneDsfmComponent(const std::string& path, int num_images) {
  TextReader reader(path);
  std::set<int> component;
  while (reader.NextDataLine()) {
    const int index = ReadIndex(reader, "image index", num_images);
    reader.ExpectLineEnd();
    if (!component.insert(index).second) {
      reader.Fail("image index " + std::to_string(index) + " appears twice");
    }
  }
  return {component.begin(), component.end()};
}

std::vector<OneDsfmEdge> ReadOneDsfmEdges(const std::string& path, int num_images) {
  TextReader reader(path);
  std::vector<OneDsfmEdge> edges;
  std::set<std::pair<int, int>> pairs;
  while (reader.NextDataLine()) {
    edges.push_back(ReadEdge(reader, num_images));
    if (!pairs.insert(std::minmax(edges.back().i, edges.back().j)).second) {
      reader.Fail("the edge between images " + std::to_string(edges.back().i) + " and " +
                  std::to_string(edges.back().j) + " appears twice");
    }
  }
  return edges;
}

OneDsfmDataset ReadOneDsfmDataset(const std::string& folder) {
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored)) throw IoError(folder, "no such folder");
  OneDsfmDataset dataset;
  dataset.folder = folder;
  dataset.images = ReadBundlerList(folder + "/list.txt");
  CheckNames(dataset.images, folder + "/list.txt");
  const int num_images = static_cast<int>(dataset.images.size());
  dataset.component = ReadOneDsfmComponent(folder + "/cc.txt", num_images);
  if (dataset.component.empty()) throw IoError(folder + "/cc.txt", "lists no image");
  dataset.edges = ReadOneDsfmEdges(folder + "/EGs.txt", num_images);
  dataset.has_photographs = std::filesystem::is_directory(folder + "/images", ignored);
  dataset.coords_path = PathIfPresent(folder, "coords.txt");
  dataset.tracks_path = PathIfPresent(folder, "tracks.txt");
  return dataset;
}

std::string OneDsfmImageName(const std::string& list_name) {
  constexpr std::string_view kPrefix = "images/";
  return list_name.starts_with(kPrefix) ? list_name.substr(kPrefix.size()) : list_name;
}

}  // namespace cairn
