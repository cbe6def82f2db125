#pragma once

#include "cairn/database/database.h"

namespace cairn {

// Does the database have features of another program whose frames are similarities, as SIFT's are?
// Features of one kind match best among themselves. The first image of them is looked at.
bool HasForeignSift(const Database& database);

}  // namespace cairn
