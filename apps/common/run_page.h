#pragma once

#include <string>

#include "cairn/mapper/reconstruct.h"
#include "cairn/report_page/report_page.h"

namespace cairn {

// The text of the page, with the database's name and the report that build_view_graph wrote beside
// it. The monitor gets the page's warnings.
std::string MakePage(const Database& database, ReportPageInput input, const RunContext& run);

// The text of report.html for a run of Reconstruct, also of one that failed. Nothing that goes
// wrong in it is worth the models: then the monitor gets a warning, and the text is empty.
std::string MakeRunPage(const Database& database, const std::string& image_path,
                        const ReconstructResult& result, const RunContext& run);

}  // namespace cairn
