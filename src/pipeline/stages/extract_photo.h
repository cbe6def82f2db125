#pragma once

#include <string>

#include "cairn/features/features.h"
#include "cairn/image/bitmap.h"

namespace cairn {

// A photograph, and its mask ("": none).
struct PhotoPaths {
  std::string path;
  std::string mask_path;
};

// Features of a photograph. Throws IoError where it cannot be read, or has not its camera's size.
Features ExtractPhoto(const PhotoPaths& photo, const ImageSize& camera_size,
                      const FeatureOptions& options);

}  // namespace cairn
