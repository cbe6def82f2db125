#pragma once

#include <optional>
#include <span>

#include "two_view/search/resampling.h"

namespace cairn::internal {

// The plane that most of `matches` lie on, as a homography of normalized points: of 20 samples the
// best, fitted to what it explains. Errors are those of HomographyErrors.
std::optional<Eigen::Matrix3d> FindPlane(const PreparedPair& pair, std::span<const int32_t> matches,
                                         double max_error_px, Rng* rng);

}  // namespace cairn::internal
