#pragma once

#include <string>

#include "cairn/bundle_adjustment/bundle_adjustment.h"

namespace cairn {

// The first value that cannot be adjusted, in words: one that is not finite, a camera or a rotation
// that is none, a standard deviation that is not positive; "": all can. Throws ConfigError where
// parts of the reconstruction do not fit together: an image without its camera, a track of what is
// not there, another number of parameters or of standard deviations.
std::string CheckBundle(const Reconstruction& reconstruction, const BundleAdjustmentScope& scope);

}  // namespace cairn
