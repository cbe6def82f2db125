#pragma once

#include <string>

#include "cairn/pipeline/stages.h"

namespace cairn {

// Options text of the depth stage. Where depth comes from is an option too: it decides what the
// samples are.
std::string DepthStageOptions(const DepthSource& source, const DepthOptions& options);

}  // namespace cairn
