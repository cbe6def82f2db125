#pragma once

#include <memory>
#include <string>

#include "cairn/database/database.h"
#include "database/query.h"

namespace cairn {

// Opens the file, creates missing tables where the mode allows, and finds out which COLMAP wrote
// it. Throws IoError.
std::unique_ptr<Database::Impl> OpenConnection(const std::string& path, Database::Mode mode);

}  // namespace cairn
