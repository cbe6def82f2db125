#include <nlohmann/json.hpp>

#include "base/text.h"
#include "cairn/evaluation/pose_evaluation.h"

namespace cairn {
namespace {

using Json = nlohmann::ordered_json;

Json OrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

std::string ThresholdKey(size_t k) {
  return "auc@" + std::to_string(static_cast<int>(kAucThresholdsDeg[k]));
}

void AddStatistics(const std::optional<ErrorStatistics>& statistics, const std::string& name,
                   const std::string& unit, Json& json) {
  json[name + "_med" + unit] = statistics ? Json(statistics->median) : Json(nullptr);
  json[name + "_mean" + unit] = statistics ? Json(statistics->mean) : Json(nullptr);
  json[name + "_std" + unit] = statistics ? Json(statistics->standard_deviation) : Json(nullptr);
}

std::string Row(const char* name, const std::optional<ErrorStatistics>& statistics, double factor) {
  if (!statistics) return Formatted("%-32s %10s %10s %10s\n", name, "-", "-", "-");
  return Formatted("%-32s %10.5g %10.5g %10.5g\n", name, factor * statistics->mean,
                   factor * statistics->median, factor * statistics->standard_deviation);
}

}  // namespace

std::string FormatPoseEvaluation(const PoseEvaluation& evaluation) {
  std::string text = Formatted("%-32s %d of %d", "registered images", evaluation.num_registered,
                               evaluation.num_reference);
  if (evaluation.num_extra > 0) text += Formatted(" (and %d others)", evaluation.num_extra);
  text += Formatted("\n%-32s", "pose AUC, %");
  for (size_t k = 0; k < kAucThresholdsDeg.size(); ++k) {
    text += Formatted(" @%g: %.2f", kAucThresholdsDeg[k], 100 * evaluation.auc[k]);
  }
  text += "\n";
  if (evaluation.relative_rotation_median_deg) {
    text += Formatted("%-32s %10.5g\n", "relative rotation, median deg",
                      *evaluation.relative_rotation_median_deg);
    text += Formatted("%-32s %10.5g\n", "relative translation, median deg",
                      *evaluation.relative_translation_median_deg);
  }
  text += Formatted("%-32s %10s %10s %10s\n", "after alignment", "mean", "median", "std");
  text += Row("orientation, deg", evaluation.orientation_deg, 1);
  text += Row("camera center, reference units", evaluation.center, 1);
  text += Row("focal length, %", evaluation.focal_relative, 100);
  std::string missing;
  for (const ImageErrors& image : evaluation.images) {
    if (!image.registered) missing += " " + image.name;
  }
  if (!missing.empty()) text += "not registered:" + missing + "\n";
  return text;
}

std::string PoseEvaluationToJson(const PoseEvaluation& evaluation) {
  Json json;
  json["registered"] = evaluation.num_registered;
  json["gt"] = evaluation.num_reference;
  json["extra"] = evaluation.num_extra;
  for (size_t k = 0; k < kAucThresholdsDeg.size(); ++k) {
    json[ThresholdKey(k)] = 100 * evaluation.auc[k];
  }
  json["rel_rot_med_deg"] = OrNull(evaluation.relative_rotation_median_deg);
  json["rel_trans_med_deg"] = OrNull(evaluation.relative_translation_median_deg);
  AddStatistics(evaluation.center, "center", "", json);
  const bool has_extent = evaluation.center && *evaluation.extent > 0;
  json["center_med_rel"] =
      has_extent ? Json(evaluation.center->median / *evaluation.extent) : Json(nullptr);
  AddStatistics(evaluation.orientation_deg, "orientation", "_deg", json);
  AddStatistics(evaluation.focal_relative, "focal_rel", "", json);
  json["images"] = Json::array();
  for (const ImageErrors& image : evaluation.images) {
    json["images"].push_back({{"name", image.name},
                              {"registered", image.registered},
                              {"orientation_deg", OrNull(image.orientation_deg)},
                              {"center", OrNull(image.center)},
                              {"focal_rel", OrNull(image.focal_relative)}});
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace cairn
