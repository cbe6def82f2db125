#pragma once

#include <string>

#include "cairn/bundle_adjustment/bundle_adjustment.h"

namespace cairn {

// Throws ConfigError where parts of a reconstruction do not fit together: an image without its
// camera, a track of what is not there, numbers of parameters or of standard deviations.
void CheckBundle(const Reconstruction& reconstruction, const BundleAdjustmentScope& scope);

// The first value that cannot be adjusted, in words: what is not finite, a camera that is none, a
// standard deviation that is not positive; "": all can.
std::string FaultOfValues(const Reconstruction& reconstruction, const BundleAdjustmentScope& scope);

}  // namespace cairn
