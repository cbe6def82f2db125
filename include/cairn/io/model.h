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

// Reads camera poses of any supported format: a COLMAP model folder, a folder of Strecha .camera
// files, or a Bundler file (a path that ends in .out) with its list. Of a folder of models, the
// first of ModelsIn. Throws IoError.
Reconstruction ReadModel(const std::string& path, const ReadModelOptions& options = {});

// The COLMAP model of a folder, or its models 0, 1, ..., of which `reconstruct` writes the largest
// first: those in itself, or else in its folder sparse. The path itself, where there is none.
std::vector<std::string> ModelsIn(const std::string& path);
// These, read. Throws IoError.
std::vector<Reconstruction> ReadModels(const std::string& path);

}  // namespace cairn
