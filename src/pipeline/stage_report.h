#pragma once

#include "cairn/pipeline/run_report.h"

namespace cairn {

// Marks the report as that of a stage that the user stopped.
void MarkStopped(StageReport& report);

}  // namespace cairn
