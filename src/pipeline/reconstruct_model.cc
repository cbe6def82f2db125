#include <algorithm>
#include <cmath>

#include "cairn/math/median.h"
#include "pipeline/reconstruct_stages.h"

namespace cairn {
namespace {

// The frame: centroid of the camera centers at the origin, their median distance from it 1, the
// first camera's rotation the identity. So it does not depend on the gauge that the stages left.
void NormalizeFrame(Reconstruction& model) {
  std::vector<Eigen::Vector3d> centers;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& [id, image] : model.images) centers.push_back(image.cam_from_world.Center());
  for (const Eigen::Vector3d& c : centers) mean += c / static_cast<double>(centers.size());
  std::vector<double> distances;
  for (const Eigen::Vector3d& c : centers) distances.push_back((c - mean).norm());
  const double median = UpperMedian(distances);
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

// Warns of places shown on top of each other, and finds the edges that did it.
std::vector<size_t> FindTwins(StageContext& context, const Reconstruction& model,
                              const ViewGraph& graph) {
  Stage stage(context, "twins");
  const std::vector<size_t> edges = EdgesBetweenTwins(model, graph, context.settings.num_threads);
  stage.Add("edges_removed", static_cast<double>(edges.size()));
  if (!edges.empty()) {
    stage.Warn("the model shows places that look alike on top of each other; the " +
               std::to_string(edges.size()) +
               " pairs between them are taken out and their images reconstructed again");
  }
  return edges;
}

// False: the model is not fit to be written, and the report's failure says why.
bool CheckModel(StageContext& context, std::span<const image_t> component, const ViewGraph& graph,
                Reconstruction& model) {
  Stage stage(context, "checks");
  model.UpdatePointErrors();
  stage.Add("images", static_cast<double>(model.images.size()));
  stage.Add("images_of_component", static_cast<double>(component.size()));
  stage.Add("points", static_cast<double>(model.points3D.size()));
  stage.Add("observations", static_cast<double>(model.NumObservations()));
  stage.Add("mean_track_length", model.MeanTrackLength());
  stage.Add("mean_reprojection_error_px", model.MeanReprojectionErrorPx());
  const Symmetry symmetry = FindSymmetry(model, graph);
  stage.Add("symmetric_pairs", symmetry.num_pairs);
  if (const std::string reason = ReasonToRefuse(model); !reason.empty()) {
    stage.Fail("the model was refused: " + reason,
               "look at the view graph with global_sfm inspect, and add photos that overlap more");
    return false;
  }
  if (context.settings.reconstruct.refuse_symmetric && symmetry.IsFold()) {
    stage.Fail(std::to_string(symmetry.num_pairs) +
                   " pairs that were taken out agree with each other that the scene turned by " +
                   std::to_string(std::lround(symmetry.angle_deg)) + " degrees looks the same, " +
                   std::to_string(symmetry.num_active) +
                   " agree with the model: it may show equal sides of a building as one",
               "give the photos of each side to a run of their own, add photos with more of the "
               "surroundings, or accept the model with --reconstruct.refuse_symmetric 0");
    return false;
  }
  for (const image_t id : component) {
    if (model.images.count(id) == 0) {
      stage.Warn(context.scene.images.at(id).name + ": not registered");
    }
  }
  return true;
}

}  // namespace

BuiltModel BuildModel(StageContext& context, std::span<const image_t> component,
                      const ViewGraph& graph) {
  BuiltModel built{std::nullopt, graph, {}};
  auto initial = AverageComponent(context, component, built.graph);
  if (!initial) return built;
  Reconstruction model = MakeReconstruction(context.scene, initial->cam_from_world);
  if (context.scene.poses_alone) {
    ReportAgreement(context, model);
    NormalizeFrame(model);
    built.model = std::move(model);
    return built;
  }
  if (!FitTracksToMemory(context, model, initial->tracks)) return built;
  RefineModel(context, initial->tracks, true, model);
  if (context.settings.reconstruct.register_left_out &&
      RegisterLeftOut(context, model, built.graph) > 0) {
    std::vector<Track> tracks = TracksOfGraph(context, built.graph).tracks;
    if (!FitTracksToMemory(context, model, tracks)) return built;
    RefineModel(context, tracks, false, model);
  }
  if (context.settings.reconstruct.separate_twins) {
    built.twin_edges = FindTwins(context, model, built.graph);
    if (!built.twin_edges.empty()) return built;
  }
  if (!CheckModel(context, component, built.graph, model)) return built;
  NormalizeFrame(model);
  RenumberPoints(model);
  built.model = std::move(model);
  return built;
}

}  // namespace cairn
