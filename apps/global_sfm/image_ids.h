#pragma once

#include <span>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// Programs number images their own ways. The model with the ids that `images` have for its names.
// Throws ConfigError where they lack one of them.
Reconstruction WithImageIdsOf(std::span<const Image> images, Reconstruction model);

}  // namespace cairn
