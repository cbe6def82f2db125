#pragma once

#include <map>
#include <string>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/camera/camera.h"
#include "cairn/database/database.h"
#include "cairn/two_view/options.h"

namespace cairn {

// Finds the focal lengths of cameras that are not planar (CameraModelIsPlanar) and have only a
// guessed one: without it, their rays are no linear map of the right ones, so that verification
// cannot fall back on fundamental matrices. Each lens' pairs (with itself, or with a camera that is
// known), some of those with many matches, are verified at focal lengths around the guess; the one
// with the largest support of all is kept in cairn_camera_lenses. It stays a guess, for bundle
// adjustment to refine. Where none is found, it is looked for again when there are other pairs.
// Returns one line a lens. Random numbers: those of verification.
std::vector<std::string> LearnWideFocals(Database& database, const TwoViewOptions& options,
                                         const RunContext& run = {});

// Whether such pairs of some cameras have more support by others in their place, which are one lens
// with the focal length that is found so, than by what is known of them.
bool HasMoreSupport(Database& database, const std::map<camera_t, Camera>& others,
                    const TwoViewOptions& options, const RunContext& run);

}  // namespace cairn
