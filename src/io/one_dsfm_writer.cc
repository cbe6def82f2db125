#include "cairn/io/one_dsfm_writer.h"

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "io/bundler_frame.h"
#include "io/writers.h"

namespace cairn {
namespace {

void CheckIndex(int index, const OneDsfmFiles& files) {
  CAIRN_CHECK(index >= 0 && index < static_cast<int>(files.images.size()));
}

void WriteList(const OneDsfmFiles& files, const std::string& path) {
  TextWriter out(path);
  for (const BundlerListEntry& image : files.images) {
    CheckOneDsfmName(image.name, path);
    out << image.name;
    if (image.focal_px) out << " 0 " << *image.focal_px;
    out << "\n";
  }
  out.Commit();
}

void WriteComponent(const OneDsfmFiles& files, const std::string& path) {
  TextWriter out(path);
  for (const int index : files.component) {
    CheckIndex(index, files);
    out << index << "\n";
  }
  out.Commit();
}

// The inverse of the reader's conversion: R = R_i R_j^T and the direction of j's center, in i's
// Bundler frame.
void WriteEdges(const OneDsfmFiles& files, const std::string& path) {
  TextWriter out(path);
  for (const OneDsfmEdge& edge : files.edges) {
    CheckIndex(edge.i, files);
    CheckIndex(edge.j, files);
    const Rigid3d cam_i_from_cam_j = Inverse(edge.cam_j_from_cam_i);
    const Eigen::Matrix3d R = FlipYZ() * cam_i_from_cam_j.RotationMatrix() * FlipYZ();
    const Eigen::Vector3d t = FlipYZ() * cam_i_from_cam_j.translation.normalized();
    out << edge.i << " " << edge.j << " " << R.row(0) << " " << R.row(1) << " " << R.row(2) << " "
        << t << "\n";
  }
  out.Commit();
}

// Keys as SIFT gives them: the center of the upper left pixel is (1, 1).
void WriteCoords(const OneDsfmFiles& files, const std::string& path) {
  TextWriter out(path);
  for (const OneDsfmImageKeys& image : files.coords) {
    CheckIndex(image.index, files);
    out << "#index = " << image.index << ", name = " << image.name
        << ", keys = " << image.keys.size() << ", px = " << image.principal_point.x()
        << ", py = " << image.principal_point.y() << ", focal = " << image.focal_px << "\n";
    for (const OneDsfmKey& key : image.keys) {
      out << key.key << " " << key.pixel.x() + 0.5 << " " << key.pixel.y() + 0.5 << " 0 0 "
          << key.color << "\n";
    }
  }
  out.Commit();
}

void WriteTracks(const OneDsfmFiles& files, const std::string& path) {
  TextWriter out(path);
  out << files.tracks.size() << "\n";
  for (const auto& track : files.tracks) {
    out << track.size();
    for (const OneDsfmObservation& observation : track) {
      CheckIndex(observation.image, files);
      out << " " << observation.image << " " << observation.key;
    }
    out << "\n";
  }
  out.Commit();
}

}  // namespace

void CheckOneDsfmName(const std::string& name, const std::string& list_path) {
  if (!name.empty() && name.find_first_of(" \t\r\n") == std::string::npos) return;
  throw IoError(list_path, "'" + name + "' cannot be a name in list.txt: it holds a blank");
}

void WriteOneDsfmFiles(const std::string& folder, const OneDsfmFiles& files) {
  CreateFolders(folder);
  WriteList(files, folder + "/list.txt");
  WriteComponent(files, folder + "/cc.txt");
  WriteEdges(files, folder + "/EGs.txt");
  WriteCoords(files, folder + "/coords.txt");
  WriteTracks(files, folder + "/tracks.txt");
}

}  // namespace cairn
