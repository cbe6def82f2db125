#include <algorithm>
#include <map>

#include "base/text.h"
#include "cairn/pipeline/build_pipeline.h"
#include "database/stage_names.h"
#include "graph/graph.h"

namespace cairn {
namespace {

void CountComponents(const std::vector<std::pair<image_pair_t, int>>& pairs,
                     ViewGraphSummary& summary) {
  const bool are_imported = summary.verified_by.contains(kImportedVerifier);  // without inliers
  std::map<image_t, int> nodes;
  const auto node = [&nodes](image_t id) {
    return nodes.emplace(id, static_cast<int>(nodes.size())).first->second;
  };
  std::vector<GraphEdge> edges;
  for (const auto& [pair, num_inliers] : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    if (num_inliers > 0 || are_imported) edges.push_back({node(id1), node(id2)});
  }
  for (const auto& component : ConnectedComponents(static_cast<int>(nodes.size()), edges).nodes) {
    ++summary.num_components;
    summary.largest_component =
        std::max(summary.largest_component, static_cast<int>(component.size()));
  }
}

// Which steps decided pairs, or that there is no depth.
std::string DepthText(const ViewGraphSummary& s) {
  if (s.num_tried == 0) return "";
  if (s.num_images_with_depth == 0) {
    return "depth     no photograph has any, so that no pair was decided by 1AC+D (--depth_path, "
           "--depth_model)\n";
  }
  std::string text = "decided  ";
  for (const auto& [step, num_pairs, seconds] : s.decided_by) {
    text += Formatted("%s %s %lld (%.2f ms each)", text.size() > 9 ? "," : "", step.c_str(),
                      static_cast<long long>(num_pairs),
                      1e3 * seconds / static_cast<double>(num_pairs));
  }
  return text + "\n";
}

// "12 (a 10, b 2)".
std::string WithParts(int64_t total, const std::map<std::string, int64_t>& parts) {
  std::string text = std::to_string(total);
  std::string list;
  for (const auto& [name, count] : parts) {
    list += (list.empty() ? "" : ", ") + name + " " + std::to_string(count);
  }
  return list.empty() ? text : text + " (" + list + ")";
}

}  // namespace

ViewGraphSummary SummarizeDatabase(const Database& database) {
  ViewGraphSummary summary;
  summary.num_images = static_cast<int>(database.ReadImages().size());
  for (const auto& [id, num] : database.ReadNumKeypoints())
    summary.num_images_with_features += num > 0;
  summary.num_images_with_depth = static_cast<int>(database.ReadNumDepthSamples().size());
  for (const PhotoRecord& photo : database.ReadPhotos()) {
    summary.num_skipped_photos += !photo.error.empty();
  }
  summary.num_pairs = std::ssize(database.ReadNumMatches());
  if (summary.num_pairs == 0) summary.num_pairs = std::ssize(database.ReadPairChoices());
  const auto num_inliers = database.ReadNumInliers();
  for (const auto& [pair, num] : num_inliers) summary.num_verified += num > 0;
  summary.verified_by = database.CountWinners();
  summary.decided_by = database.ReadStepTimes();
  int64_t num_ours = 0;
  for (const auto& [verifier, num] : summary.verified_by) num_ours += num;
  summary.num_verified = std::max(summary.num_verified, num_ours);  // Imported ones lack inliers.
  if (summary.num_verified > num_ours) {
    summary.verified_by["given"] = summary.num_verified - num_ours;
  }
  if (!summary.verified_by.contains(kImportedVerifier)) summary.num_tried = num_ours;
  for (const auto& [reason, num] : database.CountRejections()) {
    if (reason == PairStatusName(PairStatus::kTooFewMatches)) {
      summary.num_too_few = num;
    } else {
      summary.rejected_by[reason] = num;
      summary.num_tried += num;
    }
  }
  CountComponents(num_inliers, summary);
  return summary;
}

std::vector<std::pair<std::string, double>> SummaryValues(const ViewGraphSummary& s) {
  std::vector<std::pair<std::string, double>> values = {
      {"images", s.num_images},
      {"images_with_features", s.num_images_with_features},
      {"images_with_depth", s.num_images_with_depth},
      {"skipped_photographs", s.num_skipped_photos},
      {"pairs", static_cast<double>(s.num_pairs)},
      {"pairs_with_too_few_matches", static_cast<double>(s.num_too_few)},
      {"tried", static_cast<double>(s.num_tried)},
      {"verified", static_cast<double>(s.num_verified)}};
  for (const auto& [verifier, num] : s.verified_by) {
    values.emplace_back("verified_by_" + verifier, static_cast<double>(num));
  }
  for (const auto& [reason, num] : s.rejected_by) {
    values.emplace_back("rejected_" + reason, static_cast<double>(num));
  }
  for (const auto& [step, num_pairs, seconds] : s.decided_by) {
    values.emplace_back("decided_by_" + step, static_cast<double>(num_pairs));
    values.emplace_back("seconds_of_" + step, seconds);
  }
  values.emplace_back("components", s.num_components);
  values.emplace_back("images_in_largest_component", s.largest_component);
  return values;
}

std::string SummaryText(const ViewGraphSummary& s, const RunReport& report) {
  int64_t num_rejected = 0;
  for (const auto& [reason, num] : s.rejected_by) num_rejected += num;
  std::string text;
  text += "images    " + std::to_string(s.num_images) + " (" +
          std::to_string(s.num_images_with_features) + " with features, " +
          std::to_string(s.num_images_with_depth) + " with depth), " +
          std::to_string(s.num_skipped_photos) + " photographs skipped\n";
  const bool is_ours = s.num_tried + s.num_too_few > 0;
  text += "pairs     " + std::to_string(s.num_pairs);
  if (is_ours) {
    text += ", " + std::to_string(s.num_too_few) + " with too few matches, " +
            std::to_string(s.num_tried) + " tried";
  }
  text += "\nverified  " + WithParts(s.num_verified, s.verified_by) + "\n";
  if (is_ours) text += "rejected  " + WithParts(num_rejected, s.rejected_by) + "\n";
  text += DepthText(s);
  text += "graph     " + std::to_string(s.num_components) + " component" +
          (s.num_components == 1 ? "" : "s") + ", the largest with " +
          std::to_string(s.largest_component) + " images\n";
  using Seconds = std::pair<std::string, double>;
  std::vector<Seconds> seconds;  // rounds repeat stages
  for (const StageReport& stage : report.stages) {
    const auto known = std::ranges::find(seconds, stage.name, &Seconds::first);
    if (known == seconds.end()) {
      seconds.emplace_back(stage.name, stage.seconds);
    } else {
      known->second += stage.seconds;
    }
  }
  std::string times;
  for (const auto& [name, sum] : seconds) times += Formatted(" %s %.2f", name.c_str(), sum);
  if (!times.empty()) text += "seconds  " + times + "\n";
  for (const ResultWarning& warning : report.warnings) {
    text += "warning   " + WarningText(warning) + "\n";
  }
  return text;
}

}  // namespace cairn
