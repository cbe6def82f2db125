#pragma once

#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

struct ReadModelOptions {
  // The list of a Bundler file; "": the file list.txt beside it.
  std::string list_path = "";
  // false: poses and intrinsics are enough (points of Bundler files are not read; those of 1DSfM's
  // references cannot be, see bundler.h).
  bool read_points = true;
};

// Reads camera poses of any supported format: a COLMAP model folder, a folder of Strecha .camera
// files, or a Bundler file (a path that ends in .out) with its list. Throws IoError.
Reconstruction ReadModel(const std::string& path, const ReadModelOptions& options = {});

}  // namespace cairn
