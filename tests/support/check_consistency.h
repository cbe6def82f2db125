#pragma once

#include <algorithm>

#include "cairn/base/check.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// Points refer to observations that refer back, tracks are sorted and distinct,
// poses and points are finite, cameras exist. Throws BugError.
inline void CheckConsistency(const Reconstruction& model) {
  for (const auto& [id, image] : model.images) {
    CAIRN_CHECK_EQ(id, image.image.image_id);
    CAIRN_CHECK(model.cameras.count(image.image.camera_id) == 1);
    CAIRN_CHECK_EQ(image.points2D.size(), image.point3D_ids.size());
    CAIRN_CHECK(image.cam_from_world.translation.allFinite());
    CAIRN_CHECK(image.cam_from_world.rotation.coeffs().allFinite());
    for (size_t i = 0; i < image.point3D_ids.size(); ++i) {
      if (image.point3D_ids[i] == kInvalidPoint3DId) continue;
      const Track& track = model.points3D.at(image.point3D_ids[i]).track;
      const TrackElement element{id, static_cast<point2D_t>(i)};
      CAIRN_CHECK(std::find(track.begin(), track.end(), element) != track.end());
    }
  }
  for (const auto& [id, point] : model.points3D) {
    CAIRN_CHECK(point.xyz.allFinite());
    CAIRN_CHECK_GE(point.track.size(), size_t{2});
    for (size_t i = 1; i < point.track.size(); ++i) {
      CAIRN_CHECK(point.track[i - 1] < point.track[i]);
    }
    for (const TrackElement& element : point.track) {
      CAIRN_CHECK_EQ(model.images.at(element.image_id).point3D_ids.at(element.point2D), id);
    }
  }
}

}  // namespace cairn
