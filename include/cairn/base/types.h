#pragma once

#include <cstdint>
#include <limits>
#include <utility>

namespace cairn {

// Identifiers, as in COLMAP's database, which counts from 1.
using camera_t = uint32_t;
using image_t = uint32_t;
using image_pair_t = uint64_t;
using point2D_t = uint32_t;  // Index of a keypoint within its image.
using point3D_t = uint64_t;

inline constexpr camera_t kInvalidCameraId = std::numeric_limits<camera_t>::max();
inline constexpr image_t kInvalidImageId = std::numeric_limits<image_t>::max();
inline constexpr point2D_t kInvalidPoint2D = std::numeric_limits<point2D_t>::max();
inline constexpr point3D_t kInvalidPoint3DId = std::numeric_limits<point3D_t>::max();

// COLMAP's pair id: 2147483647 * smaller id + larger id. The order of the arguments does not
// matter.
inline constexpr uint64_t kMaxNumImages = 2147483647;

inline image_pair_t ImagePairToPairId(image_t id1, image_t id2) {
  if (id1 > id2) std::swap(id1, id2);
  return kMaxNumImages * id1 + id2;
}

// The two image ids of a pair, smaller one first.
inline std::pair<image_t, image_t> PairIdToImagePair(image_pair_t pair_id) {
  const image_t id2 = static_cast<image_t>(pair_id % kMaxNumImages);
  return {static_cast<image_t>((pair_id - id2) / kMaxNumImages), id2};
}

}  // namespace cairn
