#include "cairn/report/run_report.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "cairn/base/named_value.h"

namespace cairn {
namespace {

using Json = nlohmann::ordered_json;

// Whole numbers without a decimal point.
Json Number(double value) {
  const auto whole = static_cast<int64_t>(value);
  if (static_cast<double>(whole) == value) return whole;
  return value;
}

Json Values(const std::vector<std::pair<std::string, double>>& values) {
  Json json = Json::object();
  for (const auto& [key, value] : values) json[key] = Number(value);
  return json;
}

}  // namespace

std::string_view StageStatusName(StageStatus status) {
  constexpr NamedValue<StageStatus> kNames[] = {{StageStatus::kOk, "ok"},
                                                {StageStatus::kWarning, "warning"},
                                                {StageStatus::kFailed, "failed"},
                                                {StageStatus::kStopped, "stopped"},
                                                {StageStatus::kSkipped, "skipped"}};
  return NameOf(kNames, status);
}

double StageReport::Value(std::string_view key) const {
  const auto entry = std::ranges::find(values, key, &std::pair<std::string, double>::first);
  return entry == values.end() ? 0 : entry->second;
}

std::string WarningText(const ResultWarning& warning) {
  return warning.what + (warning.advice.empty() ? "" : "; " + warning.advice);
}

std::string ToJson(const RunReport& report) {
  Json json;
  json["program"] = report.program;
  json["seed"] = report.seed;
  json["num_threads"] = report.num_threads;
  json["succeeded"] = report.Succeeded();
  if (!report.Succeeded()) json["failure"] = report.failure;
  json["warnings"] = Json::array();
  for (const ResultWarning& warning : report.warnings) {
    json["warnings"].push_back({{"level", warning.is_wrong ? "wrong" : "doubtful"},
                                {"what", warning.what},
                                {"advice", warning.advice}});
  }
  json["values"] = Values(report.values);
  json["stages"] = Json::array();
  for (const StageReport& stage : report.stages) {
    Json item;
    item["name"] = stage.name;
    item["status"] = StageStatusName(stage.status);
    item["seconds"] = stage.seconds;
    if (stage.memory_gib > 0) item["memory_gib"] = stage.memory_gib;
    item["values"] = Values(stage.values);
    if (!stage.messages.empty()) item["messages"] = stage.messages;
    json["stages"].push_back(std::move(item));
  }
  // Messages may quote file names in any encoding.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace cairn
