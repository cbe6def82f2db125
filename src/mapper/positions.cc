#include <algorithm>

#include "cairn/translation_averaging/translation_averaging.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

std::vector<PointDirections> RaysOfTracks(
    const SceneData& scene, const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
    std::span<const Track> tracks) {
  std::vector<PointDirections> points;
  for (const Track& track : tracks) {
    PointDirections point;
    for (const TrackElement& element : track) {
      const auto rotation = cam_from_world.find(element.image_id);
      if (rotation == cam_from_world.end()) continue;
      const Camera& camera = scene.CameraOf(element.image_id);
      const auto ray = camera.RayFromImg(scene.pixels.at(element.image_id).at(element.point2D));
      if (!ray) continue;
      point.rays.push_back({element.image_id, rotation->second.conjugate() * *ray});
    }
    if (point.rays.size() >= 2) points.push_back(std::move(point));
  }
  return points;
}

// Camera centers; edges that the 1DSfM filter dropped get their reason.
std::optional<std::map<image_t, Rigid3d>> AverageComponentTranslations(
    StageContext& context, const std::map<image_t, Eigen::Quaterniond>& rotations,
    std::span<const Track> tracks, ViewGraph& graph) {
  ModelStage stage(context, "translation_averaging");
  std::vector<DirectionEdge> directions;
  std::vector<size_t> edge_indices;
  for (size_t i = 0; i < graph.edges.size(); ++i) {
    const ViewEdge& edge = graph.edges[i];
    if (!edge.IsActive() || !edge.HasTranslation()) continue;
    const Eigen::Vector3d direction =
        rotations.at(edge.image_id2).conjugate() * -edge.cam2_from_cam1.translation;
    directions.push_back({edge.image_id1, edge.image_id2, direction});
    edge_indices.push_back(i);
  }
  if (!context.scene.poses_alone) FindBaselineLengths(context, rotations, directions);
  const std::vector<PointDirections> points =
      RaysOfTracks(context.scene, rotations,
                   SelectTracks(tracks, context.settings.reconstruct.position_tracks_per_image));
  const TranslationAveragingReport report =
      AverageTranslations(directions, points, context.settings.translation_averaging, context.run,
                          PriorsOfCenters(context, rotations));
  stage.Add("edges_in", directions.size());
  stage.Add("tracks_in", points.size());
  stage.Add("edges_removed", report.num_filtered);
  stage.Add("images_out", report.centers.size());
  stage.Add("positions_known", report.num_priors);
  stage.Add("iterations", report.num_iterations);
  stage.Add("by_lengths", report.is_by_lengths);
  stage.Add("median_edge_error_deg", report.median_edge_error_deg);
  stage.Add("median_ray_error_deg", report.median_ray_error_deg);
  for (const image_t id : report.not_rigid) {
    stage.Record(context.scene.images.at(id).name +
                 ": its position is not determined by directions; tried again later");
  }
  if (report.status != TranslationAveragingStatus::kSuccess) {
    std::string reason(TranslationAveragingStatusName(report.status));
    if (!report.message.empty()) reason += ": " + report.message;
    stage.Fail(reason + " (" + std::to_string(directions.size()) + " directions, " +
                   std::to_string(points.size()) + " tracks)",
               "add photos that connect the scene better, or loosen "
               "--translation_averaging.filter_max_inconsistency");
    return std::nullopt;
  }
  for (size_t k = 0; k < edge_indices.size(); ++k) {
    if (report.edge_is_filtered[k]) {
      graph.edges[edge_indices[k]].removal = EdgeRemoval::kDirectionInconsistent;
    }
  }
  std::map<image_t, Rigid3d> poses;
  for (const auto& [id, center] : report.centers) {
    const Eigen::Quaterniond& rotation = rotations.at(id);
    poses[id] = Rigid3d(rotation, Eigen::Vector3d(rotation * -center));
  }
  return poses;
}

}  // namespace

TrackReport TracksOfGraph(const StageContext& context, const ViewGraph& graph,
                          const std::map<image_pair_t, FeatureMatches>& again) {
  std::vector<PairMatches> pairs;
  for (const ViewEdge& edge : graph.edges) {
    if (!edge.IsActive()) continue;
    const auto found = again.find(edge.PairId());
    const FeatureMatches& matches =
        found == again.end() ? context.scene.matches.at(edge.PairId()) : found->second;
    pairs.push_back({edge.image_id1, edge.image_id2, matches});
  }
  return BuildTracks(pairs, context.settings.tracks, context.run);
}

std::optional<InitialModel> AverageComponent(
    StageContext& context, const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
    ViewGraph& graph) {
  const auto rotations = ChooseEdges(context, cam_from_world, graph);
  if (!rotations) return std::nullopt;
  InitialModel model;
  {
    ModelStage stage(context, "tracks");
    TrackReport report = TracksOfGraph(context, graph);
    stage.Add("matches_in", report.num_matches);
    stage.Add("conflicting", report.num_conflicting);
    stage.Add("tracks_out", report.num_tracks);
    stage.Add("observations_out", report.num_observations);
    model.tracks = std::move(report.tracks);
  }
  auto poses = AverageComponentTranslations(context, *rotations, model.tracks, graph);
  if (!poses) return std::nullopt;
  model.cam_from_world = std::move(*poses);
  return model;
}

}  // namespace cairn
