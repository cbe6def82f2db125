#pragma once

#include <string>

#include "cairn/database/database.h"

namespace cairn {

// Prepares the database for --recompute STAGE: removes what the stage and its dependents wrote.
// "none": nothing. Throws ConfigError if something would be lost that cannot be computed again.
void PrepareRecompute(Database& database, const std::string& stage, const std::string& image_path);

// Does --recompute RECOMPUTE remove the stage's record, and with it its options?
bool ForgetsStage(const std::string& recompute, const std::string& stage);

}  // namespace cairn
