#pragma once

#include <optional>

#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// Weighs an essential matrix against a fundamental one among the matches that affine frames bear
// out, which need no focal length to be believed. There nearly every match is right, so that a few
// samples of seven find F: 0.1 ms. `pair` is ordered by consensus. Absent where too few matches are
// borne out.
std::optional<FocalEvidence> WeighFocals(const PreparedPair& pair, const Eigen::Matrix3d& E,
                                         const TwoViewOptions& options);

}  // namespace cairn::internal
