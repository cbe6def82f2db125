#pragma once

#include "cairn/base/peers.h"

namespace cairn {

// What every other rank of a job does while rank 0 runs RunBuildPipeline: computes what it is sent,
// until rank 0 leaves. It needs no database, and of the options none; photographs it reads by the
// paths that rank 0 knows them by. What goes wrong is told to rank 0, whose run it ends.
void HelpToBuild(Peers& peers);

}  // namespace cairn
