#pragma once

#include <string>

#include "cairn/features/features.h"
#include "cairn/image/bitmap.h"

namespace cairn {

// Features of a photograph. Throws IoError where it cannot be read, or has not its camera's size.
Features ExtractPhoto(const std::string& path, const ImageSize& camera_size,
                      const FeatureOptions& options);

}  // namespace cairn
