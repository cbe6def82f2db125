#pragma once

#include <utility>
#include <vector>

#include "cairn/synthetic/scene.h"

namespace cairn {

// The scene points that an image shows, with their keypoints, sorted by point; empty for a
// distractor.
using VisiblePoints = std::vector<std::pair<point3D_t, point2D_t>>;
VisiblePoints FindVisiblePoints(const SyntheticScene& scene, image_t image_id);

// Keypoints of common points, by the points' ids.
FeatureMatches CommonPoints(const VisiblePoints& visible1, const VisiblePoints& visible2);

// MakeMatches for callers that go over many pairs.
SyntheticMatches MakeMatches(const SyntheticScene& scene, image_t image_id1, image_t image_id2,
                             const VisiblePoints& visible1, const VisiblePoints& visible2);

}  // namespace cairn
