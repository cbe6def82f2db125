#pragma once

#include <string>

#include "cairn/pipeline/build_pipeline.h"

namespace cairn {

// Prepares the database for --recompute STAGE: removes what the stage and its dependents wrote.
// Of none and changed, nothing. Throws ConfigError if something would be lost that cannot be
// computed again.
void PrepareRecompute(Database& database, BuildStage stage, const std::string& image_path);

// Removes what the stage wrote, and those whose results follow from its own (rows of other programs
// too).
void ClearStageAndDependents(Database& database, BuildStage stage);

}  // namespace cairn
