#pragma once

#include <Eigen/Core>
#include <optional>

#include "cairn/camera/camera.h"
#include "cairn/image/bitmap.h"

namespace cairn {

// The pinhole camera for data sets that hold one focal length and no principal point:
// SIMPLE_PINHOLE of the same size and mean focal length, principal point at the image center.
Camera CenteredPinhole(const Camera& camera);

// The pinhole camera of the same view in width x height pixels. The camera is planar.
Camera ResizedPinhole(const Camera& camera, int width, int height);

// The sides of bitmaps that ResampleBitmap takes and gives are at most this, pixels (OpenCV).
inline constexpr int kMaxResampledSide = 32766;

// How ResampleBitmap reads the source: linearly between its pixels, and black beyond its border; or
// by cubics, and its nearest pixels beyond it.
enum class Resampling { kLinear, kCubic };

// The image that `target` would have taken from the same place as `source`, by OpenCV's remap: for
// every target pixel, the source is read where it shows that ray. Any central camera is a source;
// the target is planar. Where the target has fewer pixels for a view than the source, the image is
// made with the source's resolution and then averaged over areas, so that nothing aliases. The
// bitmap's size is the source camera's. Where both cameras are the same, the result is equal to the
// source to the bit. Single-threaded.
Bitmap ResampleBitmap(const Bitmap& bitmap, const Camera& source, const Camera& target,
                      Resampling resampling = Resampling::kLinear);

// A bitmap reduced to a size by averaging over areas, so that nothing aliases and pixel areas map
// onto each other.
Bitmap ReducedBitmap(const Bitmap& bitmap, int width, int height);

// Where a source pixel lies in the target; nullopt where the source has no ray of it, or the target
// no pixel of the ray.
std::optional<Eigen::Vector2d> ResamplePixel(const Eigen::Vector2d& pixel, const Camera& source,
                                             const Camera& target);

// Whether the source's distortion folds the image over within the target: what is farther off axis
// than the fold, ResampleBitmap leaves black.
bool FoldsWithin(const Camera& source, const Camera& target);

// Where the source shows a pixel of the target; nullopt where it shows none, and where distortion
// turns the image over. (Beyond a fold, some models show a pixel once more.)
std::optional<Eigen::Vector2d> ShownPixel(const Eigen::Vector2d& pixel, const Camera& source,
                                          const Camera& target);

}  // namespace cairn
