#pragma once

#include <span>

#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/triangulation/triangulation.h"

namespace cairn {

struct TriangulateTracksReport {
  int64_t num_tracks = 0;        // given, with at least two registered images
  int64_t num_small_angle = 0;   // tracks without a point, by reason
  int64_t num_inconsistent = 0;  // no two views agree, or they do not tell where
  int64_t num_points = 0;
  int64_t num_observations = 0;
};

// Replaces the points of `reconstruction` by those triangulated from `tracks` under its present
// poses and cameras. Observations of images that are not registered are ignored. Points are in the
// order of the tracks, ids from 1. The result does not depend on run.num_threads.
TriangulateTracksReport TriangulateTracks(std::span<const Track> tracks,
                                          Reconstruction& reconstruction,
                                          const TriangulationOptions& options = {},
                                          const RunContext& run = {});

struct FilterReport {
  int64_t num_observations_removed = 0;  // error too large, or behind the camera
  int64_t num_points_removed = 0;        // too few observations left, or too small an angle
};

// Removes what does not fit the present poses: observations with larger errors than the options
// allow, then points with too few of them or with too small an angle.
FilterReport FilterPoints(Reconstruction& reconstruction, const TriangulationOptions& options = {},
                          const RunContext& run = {});

}  // namespace cairn
