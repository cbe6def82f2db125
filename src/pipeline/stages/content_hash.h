#pragma once

#include <cstdint>
#include <span>

#include "base/hash.h"
#include "cairn/camera/camera.h"
#include "cairn/scene/features.h"

namespace cairn {

// Hashes of values, for noticing that a stage's inputs changed.

inline uint64_t HashKeypoints(std::span<const Keypoint> keypoints) {
  return Hasher().AddBytes(keypoints.data(), keypoints.size_bytes()).Digest();
}

inline uint64_t HashDescriptors(const Descriptors& descriptors) {
  return Hasher().AddBytes(descriptors.data(), static_cast<size_t>(descriptors.size())).Digest();
}

inline uint64_t HashMatches(const FeatureMatches& matches) {
  return Hasher().AddBytes(matches.data(), matches.size() * sizeof(FeatureMatch)).Digest();
}

// What the geometry of a pair depends on; not the camera's id.
inline uint64_t HashCamera(const Camera& camera) {
  Hasher hasher;
  hasher.Add(static_cast<int>(camera.model)).Add(camera.width).Add(camera.height);
  for (const double param : camera.params) hasher.Add(param);
  return hasher.Add(camera.has_prior_focal_length ? 1 : 0).Digest();
}

}  // namespace cairn
