#pragma once

#include <string>
#include <vector>

#include "cairn/scene/reconstruction.h"

namespace cairn {

struct ReadModelOptions {
  // The list of a Bundler file; "": the file list.txt beside it.
  std::string list_path = "";
  // false: poses and intrinsics are enough (points of Bundler files are not read; those of 1DSfM's
  // references cannot be, see bundler.h).
  bool read_points = true;
};

// The largest model in a folder that `reconstruct` wrote (or COLMAP's mapper): sparse/0. The path
// itself, where that is a model, or where there is none.
std::string LargestModelIn(const std::string& path);

// Reads camera poses of any supported format: a COLMAP model folder, a folder of Strecha .camera
// files, or a Bundler file (a path that ends in .out) with its list. Of a folder of models, the
// largest (LargestModelIn). Throws IoError.
Reconstruction ReadModel(const std::string& path, const ReadModelOptions& options = {});

// The path itself where it is a model; or else, of a folder, the COLMAP models 0, 1, ... in it or
// in its folder sparse.
std::vector<std::string> ModelsIn(const std::string& path);
// These, read. Throws IoError.
std::vector<Reconstruction> ReadModels(const std::string& path);

}  // namespace cairn
