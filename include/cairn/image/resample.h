#pragma once

#include <Eigen/Core>
#include <optional>

#include "cairn/camera/camera.h"
#include "cairn/image/bitmap.h"

namespace cairn {

// The pinhole camera for data sets that hold one focal length and no principal point:
// SIMPLE_PINHOLE of the same size and mean focal length, principal point at the image center.
Camera CenteredPinhole(const Camera& camera);

// The image that `target` would have taken from the same place as `source`: for every target pixel,
// the source is read where it shows that ray (cubic convolution, Keys 1981; beyond the source's
// border its nearest pixel). The bitmap's size is the source camera's. Where both cameras are the
// same, the result is equal to the source to the bit.
Bitmap ResampleBitmap(const Bitmap& bitmap, const Camera& source, const Camera& target);

// Where a source pixel lies in the target; nullopt where the source's distortion has no inverse.
std::optional<Eigen::Vector2d> ResamplePixel(const Eigen::Vector2d& pixel, const Camera& source,
                                             const Camera& target);

}  // namespace cairn
