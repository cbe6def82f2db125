#pragma once

#include <string>

#include "cairn/database/database.h"

namespace cairn {

// Prepares the database for --recompute STAGE: removes what the stage and its dependents wrote.
// "none" and "changed": nothing. Throws ConfigError if something would be lost that cannot be
// computed again.
void PrepareRecompute(Database& database, const std::string& stage, const std::string& image_path);

}  // namespace cairn
