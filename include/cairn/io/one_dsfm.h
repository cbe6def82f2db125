#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "cairn/geometry/rigid3d.h"
#include "cairn/io/bundler.h"

namespace cairn {

// The files of a 1DSfM data set (Wilson and Snavely 2014; src/io/FORMATS.md), in cairn's frames.
// Images are counted from 0 in the order of list.txt. Every reader throws IoError; the path is
// "<file>:<line>".

// A line of EGs.txt. The file has R = R_i R_j^T and the direction to camera j's center in camera
// i's frame, both in Bundler's camera frame; here they are converted.
struct OneDsfmEdge {
  int i = 0;
  int j = 0;
  Rigid3d cam_j_from_cam_i;  // |translation| = 1; rotation projected to the nearest one
};

struct OneDsfmKey {
  int key = 0;            // as tracks.txt refers to it
  Eigen::Vector2d pixel;  // center of the top-left pixel is (0.5, 0.5)
  std::array<uint8_t, 3> color = {0, 0, 0};
};

// A block of coords.txt.
struct OneDsfmImageKeys {
  int index = 0;
  std::string name;
  Eigen::Vector2d principal_point;  // half the width and height, pixels
  double focal_px = 0;              // 0: unknown
  std::vector<OneDsfmKey> keys;
};

struct OneDsfmObservation {
  int image = 0;
  int key = 0;
  auto operator<=>(const OneDsfmObservation&) const = default;
};

struct OneDsfmDataset {
  std::string folder;
  std::vector<BundlerListEntry> images;  // list.txt; names as there ("images/<file>")
  std::vector<int> component;            // cc.txt, sorted: the images to reconstruct
  std::vector<OneDsfmEdge> edges;        // EGs.txt, in file order
  bool has_photographs = false;          // folder/images is there
  std::string coords_path, tracks_path;  // "" where absent
};

// list.txt, cc.txt and EGs.txt, checked against each other: an index in cc.txt or EGs.txt that
// list.txt does not have, a repeated index or pair, a name with a blank, a matrix that is not a
// rotation, and an empty cc.txt are errors.
OneDsfmDataset ReadOneDsfmDataset(const std::string& folder);

std::vector<int> ReadOneDsfmComponent(const std::string& path, int num_images);
std::vector<OneDsfmEdge> ReadOneDsfmEdges(const std::string& path, int num_images);
std::vector<OneDsfmImageKeys> ReadOneDsfmCoords(const std::string& path, int num_images);
std::vector<std::vector<OneDsfmObservation>> ReadOneDsfmTracks(const std::string& path,
                                                               int num_images);

// A list name without the leading "images/": the name in cairn's database, relative to
// <folder>/images.
std::string OneDsfmImageName(const std::string& list_name);

}  // namespace cairn
