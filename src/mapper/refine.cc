#include <algorithm>
#include <limits>

#include "cairn/triangulation/triangulate_tracks.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// One round: triangulate, adjust, filter.
struct Round {
  std::string name;
  std::span<const Track> tracks = {};
  double error_factor = 1.0;  // of triangulation.max_error_px
  bool distortions = true;
  bool weigh = true;  // observations by their precision, which errors at rough poses do not show
  int max_iterations = 0;
  double tolerance = 0;  // relative; not below bundle_adjustment.function_tolerance
  const PlacePriors* places = nullptr;
  std::set<camera_t> free_principal_points = {};
};

// Of rounds that only find a start: what comes next changes the cost by more. Chosen with
// collections in sight: tests/bench/README.md, "Tried without gain".
constexpr double kStartTolerance = 1e-3;
// The first rounds use the longest tracks alone, until every image has this many, and accept errors
// larger by this factor.
constexpr int kCoarseTracksPerImage = 500;
constexpr double kCoarseErrorFactor = 8.0;

// Gives every keypoint the standard deviation of the errors of keypoints like it.
void EstimateSigmas(const StageContext& context, Stage& stage, Reconstruction& model) {
  const KeypointNoise noise =
      EstimateKeypointNoise(model, context.scene.scales, context.run.num_threads);
  stage.Add("noise_floor_px", noise.floor_px);
  stage.Add("noise_per_scale", noise.per_scale);
  for (auto& [id, image] : model.images) {
    image.sigmas_px.clear();
    for (const float scale : context.scene.scales.at(id)) {
      image.sigmas_px.push_back(static_cast<float>(noise.SigmaPx(scale)));
    }
  }
}

IntrinsicsPrior PriorOf(const StageContext& context, const Round& round, camera_t id,
                        const Camera& camera) {
  const FocalCalibrationOptions& options = context.settings.focal_calibration;
  IntrinsicsPrior prior{camera.params};
  const auto held = context.scene.held_focals.find(id);
  if (held != context.scene.held_focals.end()) {
    prior.focal_sigma = held->second;
  } else {
    prior.focal_sigma = camera.has_prior_focal_length ? options.exif_sigma : options.guess_sigma;
  }
  if (round.free_principal_points.contains(id)) {
    prior.principal_point_sigma_px =
        options.principal_point_sigma * std::max(camera.width, camera.height);
  }
  return prior;
}

void Adjust(StageContext& context, const Round& round, Reconstruction& model) {
  const ReconstructSettings& settings = context.settings;
  ModelStage stage(context, "bundle_adjustment");
  BundleAdjustmentOptions options = settings.bundle_adjustment;
  options.max_iterations = std::min(options.max_iterations, round.max_iterations);
  options.function_tolerance = std::max(options.function_tolerance, round.tolerance);
  BundleAdjustmentScope scope;
  scope.focal_lengths = true;
  scope.distortions = round.distortions;
  scope.principal_points = !round.free_principal_points.empty();
  scope.fixed_cameras = context.ConstantCameras(model);
  for (const auto& [id, camera] : model.cameras) {
    scope.priors[id] =
        PriorOf(context, round, id, ByLens(context.scene.KnownCamera(id), camera.model));
  }
  if (round.places != nullptr) {
    scope.image_positions = round.places->images;
    scope.surveyed_points = round.places->points;
  }
  if (round.weigh) EstimateSigmas(context, stage, model);
  const BundleAdjustmentReport report = AdjustBundle(model, scope, options, context.run);
  stage.Add("images_in", report.num_images);
  stage.Add("points_in", report.num_points);
  stage.Add("observations_in", report.num_observations);
  stage.Add("iterations", report.num_iterations);
  stage.Add("initial_rmse", report.initial_rmse);
  stage.Add("final_rmse", report.final_rmse);
  if (report.status == BundleAdjustmentStatus::kFailed) {
    stage.Warn("bundle adjustment failed in round " + round.name +
               (report.fault.empty() ? "" : ", since " + report.fault) +
               "; poses are as before it");
  }
}

// Takes images with fewer points out; their points go with them if fewer than two views remain.
int RemoveWeakImages(int min_points, Stage& stage, Reconstruction& model) {
  std::vector<image_t> weak;
  for (const auto& [id, image] : model.images) {
    if (image.NumPoints() < min_points) weak.push_back(id);
  }
  for (const image_t id : weak) {
    stage.Record(model.images.at(id).image.name + ": removed: it sees too few points");
    RemoveImage(id, model);
  }
  return static_cast<int>(weak.size());
}

TriangulationOptions OptionsOf(const StageContext& context, const Round& round) {
  TriangulationOptions options = context.settings.triangulation;
  options.max_error_px *= round.error_factor;
  options.max_error_sigmas *= round.error_factor;
  options.min_angle_deg = context.min_angle_deg;
  return options;
}

void TriangulateRound(StageContext& context, const Round& round, Reconstruction& model) {
  ModelStage stage(context, "triangulation");
  const TriangulateTracksReport report =
      TriangulateTracks(round.tracks, model, OptionsOf(context, round), context.run);
  stage.Add("tracks_in", report.num_tracks);
  stage.Add("points_out", report.num_points);
  stage.Add("observations_out", report.num_observations);
  stage.Add("small_angle", report.num_small_angle);
  stage.Add("inconsistent", report.num_inconsistent);
}

void FilterRound(StageContext& context, const Round& round, Reconstruction& model) {
  ModelStage stage(context, "filter");
  const FilterReport report = FilterPoints(model, OptionsOf(context, round), context.run);
  stage.Add("observations_removed", report.num_observations_removed);
  stage.Add("points_removed", report.num_points_removed);
  int min_points = context.settings.reconstruct.min_image_points;
  // A start has the longest tracks alone.
  if (round.error_factor > 1)
    min_points = std::min(min_points, ReconstructOptions().min_image_points);
  stage.Add("images_removed", RemoveWeakImages(min_points, stage, model));
  stage.Add("points_out", model.points3D.size());
  stage.Add("observations_out", model.NumObservations());
}

void RunRound(StageContext& context, const Round& round, Reconstruction& model) {
  TriangulateRound(context, round, model);
  Adjust(context, round, model);
  FilterRound(context, round, model);
}

}  // namespace

Camera ByLens(const Camera& camera, CameraModel lens) {
  if (camera.model == lens) return camera;
  Camera other =
      Camera::FromFocal(camera.camera_id, lens, camera.MeanFocal(), camera.width, camera.height);
  other.has_prior_focal_length = camera.has_prior_focal_length;
  const std::vector<int> indices = other.PrincipalPointIndices();  // EQUIRECTANGULAR: none
  for (size_t i = 0; i < indices.size(); ++i) {
    other.params[indices[i]] = camera.PrincipalPoint()[static_cast<Eigen::Index>(i)];
  }
  return other;
}

Reconstruction MakeReconstruction(const SceneData& scene,
                                  const std::map<image_t, Rigid3d>& cam_from_world) {
  Reconstruction model;
  for (const auto& [id, pose] : cam_from_world) {
    AddImage(scene, id, pose, scene.CameraOf(id), model);
  }
  return model;
}

void AddImage(const SceneData& scene, image_t id, const Rigid3d& cam_from_world,
              const Camera& camera, Reconstruction& model) {
  RegisteredImage image;
  image.image = scene.images.at(id);
  image.cam_from_world = cam_from_world;
  image.points2D = scene.pixels.at(id);
  image.point3D_ids.assign(image.points2D.size(), kInvalidPoint3DId);
  model.cameras.try_emplace(image.image.camera_id, camera);
  model.images[id] = std::move(image);
}

void RemoveImage(image_t id, Reconstruction& model) {
  const RegisteredImage& image = model.images.at(id);
  for (size_t i = 0; i < image.point3D_ids.size(); ++i) {
    if (image.point3D_ids[i] == kInvalidPoint3DId) continue;
    model.RemoveObservation(image.point3D_ids[i], {id, static_cast<point2D_t>(i)});
  }
  const camera_t camera_id = image.image.camera_id;
  model.images.erase(id);
  if (std::ranges::none_of(model.images, [&](const auto& other) {
        return other.second.image.camera_id == camera_id;
      })) {
    model.cameras.erase(camera_id);
  }
}

std::map<image_t, PoseConfidence> TriangulateModel(StageContext& context,
                                                   std::span<const Track> tracks,
                                                   Reconstruction& model) {
  context.min_angle_deg = FindTrackAngles(context, tracks, model).min_deg;
  const Round round{.name = "input", .tracks = tracks};
  TriangulateRound(context, round, model);
  {
    ModelStage stage(context, "confidence");
    EstimateSigmas(context, stage, model);
  }
  FilterRound(context, round, model);
  return EstimatePoseConfidence(model, context.run);
}

void AdjustModel(StageContext& context, int max_iterations, Reconstruction& model,
                 const std::set<camera_t>& free_principal_points) {
  const Round round{.name = "as it is",
                    .max_iterations = max_iterations,
                    .free_principal_points = free_principal_points};
  Adjust(context, round, model);
  FilterRound(context, round, model);
}

void AdjustWithPriors(StageContext& context, const PlacePriors& priors, Reconstruction& model) {
  const Round round{
      .name = "positions", .max_iterations = std::numeric_limits<int>::max(), .places = &priors};
  Adjust(context, round, model);
  FilterRound(context, round, model);
}

void FindStart(StageContext& context, std::span<const Track> tracks, Reconstruction& model) {
  const TrackAngles angles = FindTrackAngles(context, tracks, model);
  context.min_angle_deg = angles.min_deg;
  context.has_mostly_parallel_rays = angles.are_mostly_none;
  // (The longest are those of what is far away.)
  std::vector<Track> wide;
  for (size_t i = 0; i < tracks.size(); ++i) {
    if (angles.of_tracks_deg[i] >= angles.min_deg) wide.push_back(tracks[i]);
  }
  const std::vector<Track> longest = SelectTracks(wide, kCoarseTracksPerImage);
  RunRound(context,
           {.name = "coarse",
            .tracks = longest,
            .error_factor = kCoarseErrorFactor,
            .distortions = false,
            .weigh = false,
            .max_iterations = 20,
            .tolerance = kStartTolerance},
           model);
  RunRound(context,
           {.name = "middle",
            .tracks = longest,
            .error_factor = 0.25 * kCoarseErrorFactor,
            .max_iterations = 20,
            .tolerance = kStartTolerance},
           model);
}

bool RefineModel(StageContext& context, std::span<const Track> tracks, RefineStart start,
                 Reconstruction& model) {
  const ReconstructOptions& options = context.settings.reconstruct;
  Round round{.name = "", .tracks = tracks, .max_iterations = std::numeric_limits<int>::max()};
  // Better poses or more edges may bring more observations in; where they do not, the model stays
  // as it is.
  int64_t num_known = start == RefineStart::kRefined ? model.NumObservations() : 0;
  int i = 0;
  for (; i < options.max_rounds && !context.run.monitor.StopRequested(); ++i) {
    round.name = std::to_string(i + 1);
    Reconstruction candidate{model.cameras, model.images, {}};
    TriangulateRound(context, round, candidate);
    const int64_t num_observations = candidate.NumObservations();
    if (static_cast<double>(num_observations) <= (1.0 + kMinGain) * num_known) break;
    num_known = num_observations;
    model = std::move(candidate);
    Adjust(context, round, model);
    FilterRound(context, round, model);
  }
  return i > 0;
}

}  // namespace cairn
