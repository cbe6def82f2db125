#pragma once

#include "cairn/features/features.h"

namespace cairn {

// The two detectors behind ExtractFeatures; the image is used as it is, without resizing.
Features ExtractAffineDog(const Bitmap& gray, const FeatureOptions& options);
Features ExtractSift(const Bitmap& gray, const FeatureOptions& options);

}  // namespace cairn
