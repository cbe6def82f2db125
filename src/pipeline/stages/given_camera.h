#pragma once

#include <optional>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/report/run_report.h"

namespace cairn {

// Of a camera whose parameters the user gives. The advice tells what is probably meant, where the
// parameters fit another size of the image.

// Why no camera is like that: its principal point outside the image, a field of view that no
// photograph has, a distortion that leaves no camera.
std::optional<ResultWarning> FindFault(const Camera& camera);

// What is doubtful of one without a fault: a principal point far from the center, a focal length
// that is not EXIF's.
std::vector<ResultWarning> FindDoubts(const Camera& camera, std::optional<double> exif_focal_px);

}  // namespace cairn
