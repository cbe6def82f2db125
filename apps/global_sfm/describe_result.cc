#include "global_sfm/describe_result.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <set>
#include <span>

#include "base/text.h"
#include "cairn/math/median.h"
#include "common/console_monitor.h"

namespace cairn {
namespace {

std::string Line(const char* name, const std::string& text) {
  return fmt::format("{:<12} {}\n", name, text);
}

std::string ModelsText(const ReconstructResult& result) {
  std::vector<std::string> models;
  for (size_t k = 0; k < result.models.size(); ++k) {
    models.push_back(fmt::format("sparse/{} with {} photos", k, result.models[k].images.size()));
  }
  return fmt::format("{}: {}", models.size(), FirstNames(models, 4));
}

std::string PhotosText(const ReconstructResult& result) {
  std::set<image_t> registered;
  for (const Reconstruction& model : result.models) {
    for (const auto& [id, image] : model.images) registered.insert(id);
  }
  std::vector<std::string> left_out;
  for (const Image& image : result.images) {
    if (!registered.contains(image.image_id)) left_out.push_back(image.name);
  }
  return fmt::format("{} of {} have a pose{}{}", registered.size(), result.images.size(),
                     left_out.empty() ? "" : "; left out: ", FirstNames(left_out, 3));
}

// How much of their matches the models explain, and how well the points determine the poses of the
// largest.
std::string ConfidenceText(const ReconstructResult& result) {
  const std::vector<double>& shares = result.explained_shares;
  std::vector<double> sigmas_deg;
  for (const auto& [id, confidence] : result.confidences.front()) {
    sigmas_deg.push_back(confidence.rotation_sigma_deg);
  }
  std::string text;
  if (!shares.empty()) {
    const auto [least, most] = std::minmax_element(shares.begin(), shares.end());
    text = fmt::format("{}{:.0f} % of verified matches agree with the poses; ",
                       *least < *most ? "at least " : "", 100 * *least);
  }
  return text + fmt::format("keypoint noise alone turns a photo by {:.2g} degrees (median)",
                            UpperMedian(sigmas_deg));
}

std::string PointsText(const ReconstructResult& result) {
  size_t num_points = 0;
  int64_t num_observations = 0;
  for (const Reconstruction& model : result.models) {
    num_points += model.points3D.size();
    num_observations += model.NumObservations();
  }
  if (num_points == 0) return "none; cameras alone";
  return fmt::format("{}, each seen by {:.1f} photos", num_points,
                     static_cast<double>(num_observations) / static_cast<double>(num_points));
}

// How far the largest model is from positions that are known; "": none is.
std::string PlaceText(const RunReport& report) {
  for (const StageReport& stage : report.stages) {
    if (stage.name != "georegistration") continue;
    for (const auto& [key, value] : stage.values) {
      if (key == "model" && value > 0) break;
      if (key == "median_residual_m")
        return fmt::format("; {:.3g} m from known positions (median)", value);
    }
  }
  return "";
}

std::string TimeText(const RunReport& report) {
  double seconds = 0, peak_gib = 0;
  for (const auto& [key, value] : report.values) {
    if (key == "seconds") seconds = value;
    if (key == "peak_memory_gib") peak_gib = value;
  }
  return fmt::format("{}, {:.2f} GiB", FormatDuration(seconds), peak_gib);
}

std::string WarningLines(const std::vector<ResultWarning>& warnings) {
  constexpr size_t kMost = 5;
  if (warnings.empty()) return Line("warnings", "none");
  std::string lines;
  for (const auto& [what, advice, is_wrong] :
       std::span(warnings).first(std::min(kMost, warnings.size()))) {
    lines += Line(lines.empty() ? "warnings" : "", advice.empty() ? what : what + "; " + advice);
  }
  if (warnings.size() <= kMost) return lines;
  return lines + Line("", fmt::format("and {} more", warnings.size() - kMost));
}

std::string ReportLine(const ReconstructResult& result, const std::string& output_path) {
  if (result.page.empty()) return Line("report", output_path + "/report.json");
  return Line("report", output_path + "/report.html (open it in a browser)");
}

}  // namespace

std::string DescribeResult(const ReconstructResult& result, const std::string& output_path,
                           const RunContext& run) {
  const RunReport& report = result.report;
  if (!report.Succeeded()) {
    return (result.models.empty() ? "" : Line("models", ModelsText(result))) +
           (report.warnings.empty() ? "" : WarningLines(report.warnings)) +
           ReportLine(result, output_path);
  }
  std::string text = Line("models", ModelsText(result)) + Line("photos", PhotosText(result)) +
                     Line("points", PointsText(result));
  if (!result.models.front().points3D.empty()) {
    text += Line("error",
                 fmt::format("{:.3f} px (mean reprojection error{}){}",
                             result.models.front().MeanReprojectionErrorPx(run.num_threads),
                             result.models.size() > 1 ? " of sparse/0" : "", PlaceText(report)));
    if (!result.confidences.empty()) text += Line("confidence", ConfidenceText(result));
  }
  text += WarningLines(report.warnings);
  text += Line("time", TimeText(report));
  text += Line("files", output_path +
                            "/: sparse, points.ply, bundle.out, confidence.csv, "
                            "view_graph.json, report.json");
  return text + ReportLine(result, output_path);
}

}  // namespace cairn
