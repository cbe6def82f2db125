#pragma once

#include "cairn/base/run_context.h"
#include "cairn/database/database.h"
#include "cairn/report/run_report.h"
#include "cairn/two_view/options.h"

namespace cairn {

// Makes fisheyes (SIMPLE_RADIAL_FISHEYE, with a guessed focal length) of cameras of our photographs
// whose pairs taught more distortion than SIMPLE_RADIAL can have, where r (1 + k r^2) does not
// reach the image's corners, and have more support by a fisheye. So bend lenses that show some 150
// degrees and more from corner to corner. Photographs of the same size that join later follow.
// Their pairs count as not verified. The report has a warning, if there are such "cameras".
StageReport TakeFisheyes(Database& database, const TwoViewOptions& options, const RunContext& run);

}  // namespace cairn
