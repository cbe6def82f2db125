#include "cairn/pipeline/reconstruct.h"

#include <algorithm>

#include "cairn/base/timer.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "pipeline/reconstruct_stages.h"

namespace cairn {
namespace {

ViewGraphResult BuildGraph(const SceneData& scene, const ReconstructSettings& settings,
                           ProgressMonitor& monitor, RunReport& report) {
  Stage stage(report, monitor, "view_graph");
  std::vector<image_t> image_ids;
  for (const auto& [id, pixels] : scene.pixels) image_ids.push_back(id);
  ViewGraphBuilderOptions options = settings.view_graph;
  if (scene.poses_imported) options.min_num_inliers = options.min_bridge_inliers = 0;
  ViewGraphResult result = BuildViewGraph(image_ids, scene.edges, options, monitor);
  stage.Add("edges_in", result.report.num_edges);
  stage.Add("edges_out", result.report.num_active_edges);
  for (const auto& [reason, count] : result.report.num_removed) {
    stage.Add("removed_" + std::string(EdgeRemovalName(reason)), count);
  }
  stage.Add("loops", static_cast<double>(result.report.num_loops));
  stage.Add("closed_loops", static_cast<double>(result.report.num_closed_loops));
  stage.Add("median_loop_error_deg", result.report.median_loop_error_deg);
  stage.Add("components", static_cast<double>(result.report.components.size()));
  if (result.report.components.empty()) {
    stage.Fail(
        "of " + std::to_string(result.report.num_edges) + " verified pairs none is fit for use",
        "lower --view_graph.min_num_inliers, or match more features");
  }
  return result;
}

// The frame: centroid of the camera centers at the origin, their median distance from it 1, the
// first camera's rotation the identity. So it does not depend on the gauge that the stages left.
void NormalizeFrame(Reconstruction& model) {
  std::vector<Eigen::Vector3d> centers;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& [id, image] : model.images) centers.push_back(image.cam_from_world.Center());
  for (const Eigen::Vector3d& c : centers) mean += c / static_cast<double>(centers.size());
  std::vector<double> distances;
  for (const Eigen::Vector3d& c : centers) distances.push_back((c - mean).norm());
  std::nth_element(distances.begin(),
                   distances.begin() + static_cast<int64_t>(distances.size() / 2), distances.end());
  const double median = distances[distances.size() / 2];
  Sim3d new_from_old;
  new_from_old.scale = median > 0 ? 1.0 / median : 1.0;
  new_from_old.rotation = model.images.begin()->second.cam_from_world.rotation;
  new_from_old.translation = -new_from_old.scale * (new_from_old.rotation * mean);
  model.Transform(new_from_old);
}

// Ids 1, 2, ... without gaps.
void RenumberPoints(Reconstruction& model) {
  std::map<point3D_t, Point3D> points = std::move(model.points3D);
  model.points3D.clear();
  for (auto& [id, image] : model.images) {
    std::fill(image.point3D_ids.begin(), image.point3D_ids.end(), kInvalidPoint3DId);
  }
  for (auto& [id, point] : points) model.AddPoint3D(point);
}

// One component from averaging to colors; nothing if the report's failure says why.
std::optional<Reconstruction> BuildModel(StageContext& context, std::span<const image_t> component,
                                         const std::string& image_path, ViewGraph graph) {
  const auto initial = AverageComponent(context, component, graph);
  if (!initial) return std::nullopt;
  Reconstruction model = MakeReconstruction(context.scene, initial->cam_from_world);
  if (context.scene.poses_alone) {
    ReportAgreement(context, model);
    NormalizeFrame(model);
    return model;
  }
  RefineModel(context, initial->tracks, true, model);
  if (context.settings.reconstruct.register_left_out &&
      RegisterLeftOut(context, model, graph) > 0) {
    RefineModel(context, TracksOfGraph(context, graph).tracks, false, model);
  }
  Stage stage(context, "checks");
  model.UpdatePointErrors();
  stage.Add("images", static_cast<double>(model.images.size()));
  stage.Add("images_of_component", static_cast<double>(component.size()));
  stage.Add("points", static_cast<double>(model.points3D.size()));
  stage.Add("observations", static_cast<double>(model.NumObservations()));
  stage.Add("mean_track_length", model.MeanTrackLength());
  stage.Add("mean_reprojection_error_px", model.MeanReprojectionErrorPx());
  if (const std::string reason = ReasonToRefuse(model); !reason.empty()) {
    stage.Fail("the model was refused: " + reason,
               "look at the view graph with global_sfm inspect, and add photos that overlap more");
    return std::nullopt;
  }
  for (const image_t id : component) {
    if (model.images.count(id) == 0) {
      stage.Warn(context.scene.images.at(id).name + ": not registered");
    }
  }
  NormalizeFrame(model);
  RenumberPoints(model);
  return model;
}

}  // namespace

void ReconstructOptions::VisitFields(OptionVisitor& v) {
  v.Int("min_model_images", min_model_images, {2, 1000000},
        "images that a model needs; the largest component is always tried");
  v.Int("max_models", max_models, {1, 1000000}, "largest number of models");
  v.Int("position_tracks_per_image", position_tracks_per_image, {0, 1000000},
        "tracks an image whose rays join translation averaging");
  v.Int("coarse_tracks_per_image", coarse_tracks_per_image, {0, 1000000},
        "tracks an image in the first rounds; 0: all");
  v.Double("coarse_error_factor", coarse_error_factor, {1, 1000},
           "how much larger errors may be in the first round");
  v.Int("max_rounds", max_rounds, {1, 1000},
        "rounds of triangulation, adjustment and filtering over all tracks");
  v.Double("min_gain", min_gain, {0, 1}, "rounds end when one adds relatively fewer observations");
  v.Int("min_image_points", min_image_points, {3, 1000000},
        "an image with fewer points is taken out");
  v.Bool("register_left_out", register_left_out,
         "try images that were left out again, by resection");
  v.Bool("colors", colors, "color the points from the photographs");
}

ReconstructResult ReconstructScene(const Database& database, const std::string& image_path,
                                   const ReconstructSettings& settings, ProgressMonitor& monitor) {
  const Timer timer;
  ReconstructResult result;
  RunReport& report = result.report;
  report.program = "global_sfm reconstruct";
  report.seed = settings.seed;
  report.num_threads = settings.num_threads;
  const SceneData scene = ReadSceneData(database, settings, monitor, report);
  for (const auto& [id, image] : scene.images) result.images.push_back(image);
  if (!report.Succeeded()) return result;
  const ViewGraphResult graph = BuildGraph(scene, settings, monitor, report);
  if (!report.Succeeded()) return result;

  const ReconstructOptions& options = settings.reconstruct;
  StageContext context{scene, settings, monitor, report};
  for (const std::vector<image_t>& component : graph.report.components) {
    const bool is_first = &component == &graph.report.components.front();
    if (static_cast<int>(result.models.size()) == options.max_models) break;
    if (!is_first && static_cast<int>(component.size()) < options.min_model_images) break;
    if (monitor.StopRequested()) {
      report.failure = "stopped by the user after " + std::to_string(result.models.size()) +
                       " models; run again to reconstruct";
      break;
    }
    context.model = static_cast<int>(result.models.size());
    std::optional<Reconstruction> model = BuildModel(context, component, image_path, graph.graph);
    if (model) {
      if (options.colors && !image_path.empty() && !model->points3D.empty()) {
        ColorPoints(context, image_path, *model);
      }
      for (const auto& [id, image] : model->images) context.taken.insert(id);
      result.models.push_back(std::move(*model));
    } else if (!is_first) {
      // A smaller component that fails does not spoil the models that there are.
      monitor.Warning(report.failure);
      report.failure.clear();
    } else {
      break;
    }
  }
  size_t num_registered = 0;
  for (const Reconstruction& model : result.models) num_registered += model.images.size();
  report.values = {{"images", static_cast<double>(scene.images.size())},
                   {"registered", static_cast<double>(num_registered)},
                   {"models", static_cast<double>(result.models.size())},
                   {"seconds", timer.Seconds()}};
  return result;
}

}  // namespace cairn
