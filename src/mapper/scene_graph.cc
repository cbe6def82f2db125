#include <algorithm>

#include "mapper/stages.h"

namespace cairn {
namespace {

// Have other programs stored what their pairs see, and no geometry of them?
bool HasNoGeometries(const SceneData& scene) {
  return !scene.foreign.empty() && std::ranges::all_of(scene.foreign, [](const auto& entry) {
    const TwoViewGeometry& geometry = entry.second;
    const bool is_of_two_views = geometry.config == TwoViewConfig::kCalibrated ||
                                 geometry.config == TwoViewConfig::kUncalibrated;
    return is_of_two_views && !geometry.cam2_from_cam1 && !geometry.E && !geometry.F && !geometry.H;
  });
}

// What to try where the most frequent reason took all pairs out.
std::string AdviceFor(const SceneData& scene, const std::map<EdgeRemoval, int>& num_removed) {
  const auto most =
      std::ranges::max_element(num_removed, {}, [](auto& entry) { return entry.second; });
  switch (most == num_removed.end() ? EdgeRemoval::kNone : most->first) {
    case EdgeRemoval::kNoPose:
      if (HasNoGeometries(scene)) {
        return "the database has no geometries of its pairs, as COLMAP's of 2017: find them by "
               "build_view_graph --database_path ... --recompute verification";
      }
      if (scene.still_parts) return scene.still_parts->what + " " + scene.still_parts->advice;
      return "the camera seems to have turned without moving, or only a plane is seen: add photos "
             "from other places";
    case EdgeRemoval::kTripletInconsistent:
    case EdgeRemoval::kAmbiguous:
      return "the pairs contradict each other: raise --view_graph.max_triplet_error_deg, or match "
             "with a smaller --matching.max_ratio";
    default:
      return "lower --view_graph.min_num_inliers, or match more features";
  }
}

}  // namespace

ViewGraphResult BuildSceneGraph(const SceneData& scene, const ReconstructSettings& settings,
                                const RunContext& run, RunReport& report) {
  RunStage stage(report, run.monitor, "view_graph");
  std::vector<image_t> image_ids;
  for (const auto& [id, pixels] : scene.pixels) image_ids.push_back(id);
  ViewGraphResult result = BuildViewGraph(image_ids, scene.edges, settings.view_graph, run);
  stage.Add("edges_in", result.report.num_edges);
  stage.Add("edges_out", result.report.num_active_edges);
  for (const auto& [reason, count] : result.report.num_removed) {
    stage.Add("removed_" + std::string(EdgeRemovalName(reason)), count);
  }
  stage.Add("loops", result.report.loops.num_loops);
  stage.Add("closed_loops", result.report.loops.num_closed);
  stage.Add("components", result.report.components.size());
  if (result.report.components.empty()) {
    std::string reasons;
    for (const auto& [reason, count] : result.report.num_removed) {
      reasons += (reasons.empty() ? "" : ", ") + std::to_string(count) + " " +
                 std::string(EdgeRemovalName(reason));
    }
    stage.Fail("of " + std::to_string(result.report.num_edges) +
                   " verified pairs none is fit for use (" + reasons + ")",
               AdviceFor(scene, result.report.num_removed));
  }
  return result;
}

}  // namespace cairn
