#include "common/run_page.h"

#include <filesystem>

#include "cairn/base/file.h"

namespace cairn {

std::string MakePage(const Database& database, ReportPageInput input, const RunContext& run) {
  input.title = std::filesystem::path(database.path()).stem().string();
  const std::string build_report = database.path() + ".report.json";
  if (std::filesystem::exists(build_report)) input.build_json = ReadFile(build_report);
  ReportPage page = MakeReportPage(database, input, run);
  for (const std::string& warning : page.warnings) run.monitor.Warning(warning);
  return std::move(page.html);
}

std::string MakeRunPage(const Database& database, const std::string& image_path,
                        const ReconstructResult& result, const RunContext& run) try {
  std::vector<std::string> names;
  for (size_t k = 0; k < result.models.size(); ++k) names.push_back("sparse/" + std::to_string(k));
  return MakePage(database,
                  {.image_path = image_path,
                   .models = result.models,
                   .model_names = names,
                   .confidences = result.confidences,
                   .graph = result.graph,
                   .run_json = ToJson(result.report)},
                  run);
} catch (const std::exception& error) {
  run.monitor.Warning(std::string("report.html could not be made: ") + error.what());
  return "";
}

}  // namespace cairn
