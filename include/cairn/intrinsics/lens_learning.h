#pragma once

#include <string>
#include <vector>

#include "cairn/base/types.h"
#include "cairn/database/database.h"

namespace cairn {

struct LearnedLenses {
  std::vector<std::string> texts;    // one a camera of which something was learned
  std::vector<image_pair_t> undone;  // their pairs that had been verified; ascending
};

// Learns the radial distortion and the focal length of cameras that nobody measured from the likely
// pairs that are verified, and stores it (cairn_camera_lenses): distortion where it is worth its
// description (intrinsics/distortion_calibration.h), then, on undistorted points, focal lengths
// that are only guessed (intrinsics/focal_calibration.h). EXIF's focal lengths stay, and so do
// cameras that look measured, those of which something is known, and all if the user gave them.
// What was found by the cameras as they had been is removed with its jobs, in the same transaction:
// these pairs have not been verified. It depends on the database alone.
LearnedLenses LearnLenses(Database& database, const std::vector<image_pair_t>& likely,
                          int num_threads);

}  // namespace cairn
