#pragma once

#include <string>

#include "cairn/mapper/reconstruct.h"

namespace cairn {

// The text of report.html for a run of Reconstruct, also of one that failed. Nothing that goes
// wrong in it is worth the models: then the monitor gets a warning, and the text is empty.
std::string MakeRunPage(const Database& database, const std::string& image_path,
                        const ReconstructResult& result, const RunContext& run);

// The text of the report that build_view_graph wrote beside the database; "": there is none.
std::string ReadBuildReport(const std::string& database_path);

}  // namespace cairn
