#include "common/run_page.h"

#include <filesystem>

#include "cairn/base/file.h"
#include "cairn/report_page/report_page.h"

namespace cairn {

std::string MakeRunPage(const Database& database, const std::string& image_path,
                        const ReconstructResult& result, const RunContext& run) try {
  std::vector<std::string> names;
  for (size_t k = 0; k < result.models.size(); ++k) names.push_back("sparse/" + std::to_string(k));
  const ReportPageInput input{.title = std::filesystem::path(database.path()).stem().string(),
                              .image_path = image_path,
                              .models = result.models,
                              .model_names = names,
                              .graph = result.graph,
                              .run_json = ToJson(result.report),
                              .build_json = ReadBuildReport(database.path())};
  ReportPage page = MakeReportPage(database, input, run);
  for (const std::string& warning : page.warnings) run.monitor.Warning(warning);
  return std::move(page.html);
} catch (const std::exception& error) {
  run.monitor.Warning(std::string("report.html could not be made: ") + error.what());
  return "";
}

std::string ReadBuildReport(const std::string& database_path) {
  const std::string path = database_path + ".report.json";
  return std::filesystem::exists(path) ? ReadFile(path) : "";
}

}  // namespace cairn
