#pragma once

#include "cairn/base/progress.h"
#include "cairn/database/database.h"
#include "cairn/report/run_report.h"

namespace cairn {

// Where there are rows that cannot be used (Database::FindBadRows): a stage "database" that names
// the first 20 of them and counts them as "bad_rows".
void ReportBadRows(const Database& database, RunReport& report, ProgressMonitor& monitor);

}  // namespace cairn
