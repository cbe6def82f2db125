#pragma once

#include <string>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/base/types.h"
#include "cairn/database/database.h"

namespace cairn {

struct LearnedLenses {
  std::vector<std::string> texts;    // one a camera of which something was learned
  std::vector<image_pair_t> undone;  // their pairs that had been verified; ascending
};

// Learns the radial distortion and the focal length of cameras without a calibration from the
// likely pairs that are verified, and stores them (cairn_camera_lenses): distortion where it is
// worth its description (intrinsics/distortion_calibration.h), then, on undistorted points, focal
// lengths that are only guessed (intrinsics/focal_calibration.h). Focal lengths from EXIF are kept,
// and so are cameras that look measured, those learned before, and all if the user gave them. The
// results of pairs of the changed cameras are removed with their jobs, in the same transaction:
// these pairs count as not verified. The result depends on the database alone.
LearnedLenses LearnLenses(Database& database, const std::vector<image_pair_t>& likely,
                          const RunContext& run = {});

}  // namespace cairn
