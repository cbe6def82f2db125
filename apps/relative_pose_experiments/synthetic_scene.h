#pragma once

#include <string>

#include "relative_pose_experiments/real_scene.h"

namespace cairn::experiments {

// What stands for the photographs where none are given: a scene of the synthetic module in
// folder/synthetic, as build_view_graph would leave it after matching, with its true model. Of the
// matches 60 % are wrong; positions, frames and depths have errors of the size that those of
// photographs have. Replaces an earlier scene. Throws IoError.
RealDataOptions WriteSyntheticScene(const std::string& folder, bool quick, uint64_t seed);

}  // namespace cairn::experiments
