#pragma once

#include <string>

#include "cairn/database/database.h"
#include "cairn/pipeline/stages.h"

namespace cairn {

// The options of the depth stage: where depth comes from decides what the samples are.
std::string DepthStageOptions(const DepthSource& source, const DepthOptions& options);

// Throws ConfigError or IoError where no depth can come from the source; "" twice is none.
void CheckDepthSource(const std::string& image_path, const DepthSource& source,
                      const DepthOptions& options);

// Throws ConfigError where there is a source, and pairs were verified without depth.
void CheckDepthIsInTime(const Database& database, const DepthSource& source);

// Throws ConfigError where the folder has a depth map of no image, and no earlier run had depth.
void CheckDepthMaps(const Database& database, const std::string& depth_path);

}  // namespace cairn
