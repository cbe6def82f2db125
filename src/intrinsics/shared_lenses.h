#pragma once

#include <map>

#include "cairn/base/types.h"
#include "cairn/database/database.h"

namespace cairn {

// Cameras that have one lens: the camera that stands for it. Their models, sizes (upright
// or on their side) and focal lengths, as the database has them, are equal. Cameras that the map
// lacks have a lens each.
using SharedLenses = std::map<camera_t, camera_t>;

// Few pairs of one photograph do not tell its lens: where most images have a camera of their own
// and the same model, size and focal length, as those without EXIF have, they are of one lens.
// (The mapper decides whether the cameras are one.)
SharedLenses FindSharedLenses(const Database& database);

// Cameras that were never looked at begin with what others of their lens have learned, the one of
// the median focal length, as a guess: photographs that join later.
void AdoptLenses(Database& database);

}  // namespace cairn
