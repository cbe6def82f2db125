#pragma once

#include <optional>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/report/run_report.h"

namespace cairn {

// What is odd of a camera whose parameters the user gives. `is_wrong`: no camera is like that (its
// principal point outside the image, a field of view that no photograph has, a distortion that
// leaves no camera); the others are doubtful (a principal point far from the center, a focal length
// that is not EXIF's). The advice tells what is probably meant, where the parameters fit another
// size of the image.
std::vector<ResultWarning> FindOddities(const Camera& camera, std::optional<double> exif_focal_px);

}  // namespace cairn
