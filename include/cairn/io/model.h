#pragma once

#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// Reads whatever holds camera poses: a COLMAP model folder, a folder of Strecha .camera files, or a
// Bundler file (a path that ends in .out) with its list. `list_path` "" means the file list.txt
// beside the Bundler file. Throws IoError.
Reconstruction ReadModel(const std::string& path, const std::string& list_path = "");

}  // namespace cairn
