#pragma once

#include <string>

#include "cairn/pipeline/build_pipeline.h"

namespace cairn {

// Prepares the database for --recompute STAGE: removes what the stage and its dependents wrote.
// Of none and changed, nothing. Rows of other programs go, too. Throws ConfigError if something
// would be lost that cannot be computed again.
void PrepareRecompute(Database& database, BuildStage stage, const std::string& image_path,
                      const DepthSource& depth);

}  // namespace cairn
