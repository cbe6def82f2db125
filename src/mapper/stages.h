#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "cairn/bundle_adjustment/pose_confidence.h"
#include "cairn/tracks/tracks.h"
#include "cairn/translation_averaging/translation_averaging.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "mapper/scene_data.h"

namespace cairn {

// What camera models leave out (a shutter that rolls, focus) may explain as much of the evidence.
inline constexpr double kModelErrors = 0.005;
// Rounds end when one gains less than this share: of the observations of a model, say.
inline constexpr double kMinGain = 0.005;

// The steps, in the order of README.md.

// read_scene.cc
SceneData ReadSceneData(const Database& database, const ReconstructSettings& settings,
                        const RunContext& run, RunReport& report);

// memory.cc
// What a database holds, by its counts alone.
struct SceneCounts {
  int64_t num_keypoints = 0;
  int64_t num_pairs = 0;
  int64_t num_matches = 0;  // inliers
};
// False: there is not so much memory, and the report has the failure, before anything is read.
bool FitsToRead(const SceneCounts& counts, const ReconstructOptions& options, RunStage& stage);
// Predicts the peak memory of RefineModel with these tracks. Where it is more than there is
// (ReconstructOptions::max_memory_gib), or than Ceres can count observations, takes fewer tracks,
// long ones first. False: not even the least that a model needs would fit, and the report has the
// failure.
bool FitTracksToMemory(StageContext& context, const Reconstruction& model,
                       std::vector<Track>& tracks);

// Peak memory, bytes, that a part of the scene takes beside what is read, at most.
int64_t EstimatePartBytes(const SceneData& part, const BundleAdjustmentOptions& options);
// How many parts of so many bytes there is memory for, one for each thread at most, 1 at least.
int NumPartsSideBySide(int64_t bytes, const ReconstructOptions& options, int num_threads);

// still_parts.cc
// What to say where most images have matches that stay where they are in the picture while others
// move, or mostly pairs that stay still as a whole: a turntable's background, marks over
// photographs.
std::optional<ResultWarning> FindStillParts(const SceneData& scene, int num_threads);

// parts.cc
// Models of the scene's parts, which share neither pairs nor cameras, each as if it were alone.
// Earlier models go on as one. Takes the parts out of the scene; images and cameras stay as they
// are stored.
ReconstructResult ReconstructParts(std::span<const Reconstruction> earlier,
                                   const ReconstructSettings& settings, const RunContext& run,
                                   SceneData& scene);

// merge_parts.cc
// Connected images that have no model, and why.
struct WithoutModel {
  std::vector<image_t> images;
  std::string reason = "--reconstruct.min_model_images, --reconstruct.max_models";
};
// Finished models of a scene, or of a part of it.
struct SceneModels {
  std::vector<Reconstruction> models;
  std::vector<std::vector<ResultWarning>> warnings;  // of each model
  std::vector<double> explained_shares;              // as in ReconstructResult
  std::vector<bool> keeps_frame;                     // likewise
  std::vector<WithoutModel> without_model;
  double evidence_nats = 0;
  int64_t num_explained = 0;  // matches
};
// The same with what became of the pairs, and the report.
struct PartResult : SceneModels {
  ViewGraph graph;
  RunReport report;
  bool is_side_by_side = false;  // it was built beside other parts
};
// One result of all parts: the largest models first, as many as there may be, and one graph. A part
// that fails leaves the others as they are. `report` has the stages before.
ReconstructResult MergeParts(std::vector<PartResult> parts, const SceneData& scene,
                             const ReconstructOptions& options, const RunContext& run,
                             RunReport report);

// calibration_search.cc
// Models and graph by the calibration of the scene whose models have the most evidence: with one
// camera for likely images or without. Earlier models tell theirs. Leaves the scene with a
// calibration that was tried.
PartResult ReconstructBest(std::span<const Reconstruction> earlier,
                           const ReconstructSettings& settings, const RunContext& run,
                           SceneData& scene);

// calibrate.cc
// Gives cameras whose intrinsics are not constant the focal lengths that the pairs' fundamental
// matrices determine, unless loops of rotations then close worse than before, and reports what
// became of each camera.
// Improves the poses of the scene's `foreign` edges, and of all whose focal lengths changed.
// Returns whether the pairs tell that a camera which images share is more than one.
bool CalibrateSceneFocals(const ReconstructSettings& settings, const RunContext& run, Stage& stage,
                          SceneData& scene);
// The geometries of the edges of these cameras.
std::map<image_pair_t, TwoViewGeometry> ReadGeometriesOf(const std::set<camera_t>& cameras,
                                                         const SceneData& scene);

// shared_camera.cc
// Groups of images that one camera each may have taken, though they have more cameras than half of
// their number (as COLMAP stores them): of one size and camera model, with the same prior focal
// length or without one. Most of a group is where this kind, together with the same on its side,
// is frequent among the images that pairs connect: a quarter and more, and such kinds are most.
std::vector<std::set<image_t>> LikelyOfOneCamera(const SceneData& scene);
// The models have several of these images, known by their names, and each model equal cameras.
bool AgreeWithOneCamera(std::span<const Reconstruction> models, const std::set<image_t>& images,
                        const SceneData& scene);
// The one of the median focal length.
Camera MedianCamera(std::vector<Camera> cameras);
// Gives these images one camera, and improves the poses of their pairs where that changes lenses.
void ShareCamera(const std::set<image_t>& images, Camera camera, const RunContext& run,
                 SceneData& scene);
// Whether pairs and models find the same cameras to have the longer focal lengths, by about as
// much: more than half of the variance of their logarithms is common to both. Where focal lengths
// absorb other errors instead (a rolling shutter, wrong distortion), little of it is.
bool PairsConfirmFocals(const SceneData& scene, std::span<const Reconstruction> models);
// Gives images that share a camera by that a camera each again, as they are stored: equal ones.
void UnshareCamera(const std::map<image_t, camera_t>& stored, Reconstruction& model);

// turned_images.cc
// Upright pictures and pictures on their side are of one camera, once turned by a quarter: joins
// such groups of LikelyOfOneCamera, and turns the pictures of the one with fewer images. Their
// images.
std::set<image_t> TurnAlike(std::vector<std::set<image_t>>& groups, SceneData& scene);
// The same pictures as they are stored, in the models and pairs of the scene.
void TurnBack(const std::set<image_t>& turned, const SceneData& scene, PartResult& result);

// exif_focals.cc
// Whether EXIF has the camera's focal length, and bundle adjustment may change it.
bool RefinesExif(const Camera& camera, const SceneData& scene);
// The images whose focal lengths in the models are more than three standard deviations off EXIF's,
// and off what the pairs found in place of it; of models whose images mostly are such.
std::set<image_t> ImagesThatLeftExif(const SceneData& scene, double exif_sigma,
                                     std::span<const Reconstruction> models);
// Holds the focal lengths of these images' cameras, EXIF's, so that to leave them by three standard
// deviations costs so much, and no less than usual.
void HoldExif(const std::set<image_t>& images, double exif_sigma, double cost_nats,
              SceneData& scene);

// scene_graph.cc
ViewGraphResult BuildSceneGraph(const SceneData& scene, const ReconstructSettings& settings,
                                const RunContext& run, RunReport& report);

// components.cc
std::map<camera_t, int> NumImagesOfCameras(const Reconstruction& model);
// Models of the graph's components, and of the parts into which they fall. Where there are earlier
// models, these first, with the images that can be registered in them, then, unless nothing is to
// be registered, models of the images that are left.
SceneModels BuildModels(StageContext& context, const std::vector<std::vector<image_t>>& components,
                        std::span<const Reconstruction> earlier, ViewGraph& graph);

// build_model.cc
// One component of the graph from averaging to the finished model. Of those that different
// rotations lead to, the one with the most evidence is kept and repaired.
BuiltModel BuildModel(StageContext& context, std::span<const image_t> component,
                      const ViewGraph& graph);
// An earlier model with the images that can be registered in it, refined, in its frame.
BuiltModel ContinueModel(StageContext& context, const Reconstruction& earlier,
                         const ViewGraph& graph);

// rotations.cc
// Global rotations of a component, by one choice of edges and weights.
struct RotationHypothesis {
  std::map<image_t, Eigen::Quaterniond> cam_from_world;
  double median_residual_deg = 0;
  int num_rejected = 0;         // edges that are further off (rotation_averaging.max_error_deg)
  double support = 0;           // inliers of the pairs, by how well they agree with it
  double possible_support = 0;  // of all pairs between its images
};
// A model of so few observations that it is built and adjusted in some seconds, whatever may come
// of it.
inline bool IsQuick(const Reconstruction& model) { return model.NumObservations() <= 500'000; }

// Independent matches of the pairs that a model with these rotations can keep.
int64_t NumExplainable(const StageContext& context, const ViewGraph& graph,
                       const RotationHypothesis& hypothesis);
// Global rotations of the component, averaged from its edges, weighed by inliers, and alike; and
// from the trees of those with the most inliers, and whose inliers cover the pictures best. Where
// these agree there is one hypothesis, else those that differ, the best supported first. Empty: the
// report has the failure.
std::vector<RotationHypothesis> HypothesizeRotations(StageContext& context,
                                                     std::span<const image_t> component,
                                                     const ViewGraph& graph);

// relative_poses.cc
// Refines the poses of edges that another program verified, or whose focal lengths changed, on
// their inlier matches, and finds those that were not stored or left open (COLMAP's
// planar-or-panoramic pairs). Edges whose matches show no parallax keep a rotation alone; those
// without any pose end with the reason kNoPose.
void ImproveRelativePoses(const std::map<image_pair_t, TwoViewGeometry>& geometries,
                          const RunContext& run, SceneData& scene);
// Gives edges that disagree with global rotations, whatever took them out, the pose near these that
// explains their matches, where there is one that explains more than half: a plane, a narrow field
// of view or few matches leave several poses that explain them all. Such edges are in use again.
// Returns how many there are.
int RefitEdges(const StageContext& context,
               const std::map<image_t, Eigen::Quaterniond>& cam_from_world, double max_error_deg,
               ViewGraph& graph);

// edges.cc
// Takes out the edges that disagree with the rotations, unless another pose that agrees explains
// their matches too, and the images that this cuts off. Rotations of the images that stay.
std::optional<std::map<image_t, Eigen::Quaterniond>> ChooseEdges(
    StageContext& context, const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
    ViewGraph& graph);
// Is it a pair of two images of the model, and of one place?
bool IsWithin(const ViewEdge& edge, const Reconstruction& model);
// The model decides which pairs between its images are in use: those of which it explains at least
// half of the matches. Returns how many matches the pairs have that come in.
int64_t ReviseEdges(const ModelEvidence& evidence, const Reconstruction& model, ViewGraph& graph);

// baseline_lengths.cc
// Finds how long the baselines of the pairs are, by points that pairs share, for global rotations,
// and how many points each pair has. Pairs that no points join with most of the others stay without
// a length, and all pairs of large scenes without both.
void FindBaselineLengths(const StageContext& context,
                         const std::map<image_t, Eigen::Quaterniond>& rotations,
                         std::vector<DirectionEdge>& directions);

// positions.cc
struct InitialModel {
  std::map<image_t, Rigid3d> cam_from_world;
  std::vector<Track> tracks;
};
// Positions of the images with these rotations, and their tracks. Edges that are dropped get their
// reason. nullopt: the report has the failure.
std::optional<InitialModel> AverageComponent(
    StageContext& context, const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
    ViewGraph& graph);
// Tracks over the graph's active edges; `again` has the matches of pairs that were verified again.
TrackReport TracksOfGraph(const StageContext& context, const ViewGraph& graph,
                          const std::map<image_pair_t, FeatureMatches>& again = {});

// refine.cc
// Cameras and keypoints of the images with a pose, no points.
Reconstruction MakeReconstruction(const SceneData& scene,
                                  const std::map<image_t, Rigid3d>& cam_from_world);
// Gives a model an image without points, and its camera where the model does not have it.
void AddImage(const SceneData& scene, image_t id, const Rigid3d& cam_from_world,
              const Camera& camera, Reconstruction& model);
// Takes an image out of a model; points that fewer than two others see, and a camera that no other
// has, go with it.
void RemoveImage(image_t id, Reconstruction& model);

// What the scene has of a camera, by the lens of its camera in a model, without distortion unless
// that is the same.
Camera ByLens(const Camera& camera, CameraModel lens);

// Rays that differ by less, once rotations are undone, hardly tell a direction or a distance.
inline constexpr double kMinParallaxPx = 4.0;

// The angles between the rays of tracks, by the model's rotations alone.
struct TrackAngles {
  // Smallest one of a point: triangulation.min_angle_deg, or, where most tracks have smaller ones,
  // half of what half of them have (adjustment changes it), and not below that of kMinParallaxPx.
  double min_deg = 0;
  bool are_mostly_none = false;  // less than that of kMinParallaxPx
  std::vector<double> of_tracks_deg;
};
TrackAngles FindTrackAngles(const StageContext& context, std::span<const Track> tracks,
                            const Reconstruction& model);

// Coarse rounds over few tracks, from poses of averaging. Sets the smallest angle of points.
void FindStart(StageContext& context, std::span<const Track> tracks, Reconstruction& model);

enum class RefineStart {
  kChanged,  // new images, or a model that was not refined
  kRefined,  // a refined model: it stays as it is unless the tracks bring more observations
};
// Rounds of triangulation, bundle adjustment and filtering over all tracks. False: the model
// stayed.
bool RefineModel(StageContext& context, std::span<const Track> tracks, RefineStart start,
                 Reconstruction& model);
// Triangulation and filtering at poses that stay as they are, and how well the points determine
// these.
std::map<image_t, PoseConfidence> TriangulateModel(StageContext& context,
                                                   std::span<const Track> tracks,
                                                   Reconstruction& model);

// Bundle adjustment and filter of the points that the model has. Principal points of these cameras
// are adjusted, too.
void AdjustModel(StageContext& context, int max_iterations, Reconstruction& model,
                 const std::set<camera_t>& free_principal_points = {});

// Bundle adjustment and filter where positions are known, too, in the model's world frame.
struct PlacePriors {
  std::map<image_t, PositionPrior> images;
  std::vector<SurveyedPoint> points;
};
void AdjustWithPriors(StageContext& context, const PlacePriors& priors, Reconstruction& model);

// same_model.cc
// The similarity that puts images of a model (`ids`; both models have them) where they are in
// another one: the rotation that most of them agree on, then scale and shift with the least sum of
// distances (20 reweighted rounds). The identity where positions are too large for that.
Sim3d FrameOf(const Reconstruction& other, const Reconstruction& model,
              std::span<const image_t> ids);
// Whether to refine a rough model would find a finished one once more: by the poses of each image,
// most points that it sees in the finished one lie where triangulation would take them.
bool LeadsTo(const StageContext& context, const Reconstruction& finished,
             const Reconstruction& rough);

// register_images.cc
// Poses for images that are in no model yet, from the points. Returns the number of new images.
int RegisterLeftOut(StageContext& context, const ViewGraph& graph, Reconstruction& model);

// judge.cc
// The evidence for the model in all verified pairs of the images that are in no other model,
// in use in the graph or not. `pairs` are in the order of graph.edges; those of other
// models' images have no matches.
ModelEvidence EvidenceFor(const StageContext& context, const Reconstruction& model,
                          const ViewGraph& graph);
Agreement AgreementFor(const StageContext& context, const Reconstruction& model,
                       const ViewGraph& graph);
// Of each image of a model, its pairs in use with others of it.
std::map<image_t, int> NumPairsInUse(const ViewGraph& graph, const Reconstruction& model);
// Warnings of a model that contradicts its own verified pairs, or parts of it that do, and of
// images that a single pair holds.
std::vector<ResultWarning> JudgeModel(StageContext& context, const BuiltModel& built);
// Of the first twenty images, and how many more there are.
std::string Names(const SceneData& scene, std::span<const image_t> images);

// grow_model.cc
// False: there is not enough memory, and the report has the failure.
bool FitAndRefine(StageContext& context, std::vector<Track> tracks, RefineStart start,
                  Reconstruction& model);
// Registers what was left out and lets the model choose its pairs, until neither brings anything.
// How often it was refined; nullopt: as above.
std::optional<int> GrowModel(StageContext& context, ViewGraph& graph, Reconstruction& model);

// replace_misplaced.cc
// Places groups of own scale and registers misplaced images anew, while that brings more evidence.
void ReplaceMisplaced(StageContext& context, BuiltModel& best);

// misplaced.cc
// Images that a model misplaces together: most of the matches of their pairs with the others
// contradict it, while those among themselves may not.
struct MisplacedGroup {
  std::set<image_t> images;
  int64_t num_contradicting = 0;  // matches with the others
};
// Of the groups, single images among them, that arise when images are joined by the pairs with the
// most explained matches first: the largest of fewer than half of the images, those with the most
// contradicting matches first.
std::vector<MisplacedGroup> FindMisplacedGroups(StageContext& context, const BuiltModel& built);
// The same by how many of the matches that agree with the model became points: between a group and
// the others less than two thirds as many as between all images. Relative poses do not tell how
// large a group is beside the others, points that both see do. (An image alone has no points of its
// own, and is no group.)
std::vector<MisplacedGroup> FindGroupsOfOwnScale(StageContext& context, const BuiltModel& built);

// hinged.cc
// Matches of which the model made one point.
int NumSharedPoints(const ViewEdge& edge, const FeatureMatches& matches,
                    const Reconstruction& model);
// Images of parts that share points, as many as resection asks for, with the rest through a single
// image: two parts with one image in common have no common scale. Of all such parts the smaller
// ones, while they are fewer than half of the images.
std::set<image_t> FindHinged(StageContext& context, const ViewGraph& graph,
                             const Reconstruction& model);
// Parts, but for the largest, that neither pairs in use nor points join with others: nothing tells
// where they are beside these.
std::vector<std::set<image_t>> FindApart(const ViewGraph& graph, const Reconstruction& model);

// place_part.cc
// These images of a part of a model, with the points that two of the part see.
Reconstruction PartOf(const Reconstruction& model, const std::set<image_t>& images,
                      const std::function<bool(image_t)>& is_of_part);
// Where matches put a part beside the rest.
struct PlaceOfPart {
  Sim3d rest_from_part;
  // Points of each that matches show in an image of the other; those that agree there, and now.
  int num_sightings = 0;
  int num_agreeing = 0;
  int num_before = 0;
};
// The place where most agree, by points of both that matches say are one, and by the relative poses
// of pairs.
PlaceOfPart PlacePart(StageContext& context, const ViewGraph& graph, const Reconstruction& rest,
                      const Reconstruction& part);
// Images of a model, and those that pairs join with them.
struct PartAndRest {
  Reconstruction part, rest;
};
PartAndRest SplitOff(const BuiltModel& built, const std::set<image_t>& images);
// Whether most points of these images and of the others that matches show in images of the other
// agree with where the images are.
bool AreInPlace(const StageContext& context, const BuiltModel& built,
                const std::set<image_t>& images);

// choose_intrinsics.cc
// Gives cameras whose distortion has one parameter a second one, where the matches agree better
// with it by more than 1.6 standard errors. Returns whether they do.
bool ChooseLensModels(StageContext& context, BuiltModel& best);
// Frees the principal points of cameras that may be freed, from here on, where the matches agree
// better with what bundle adjustment then finds, by as much, or, in an earlier model, which has
// kept the image centers, beyond doubt; of the others it warns, where they do beyond doubt. Returns
// whether there are some. Forward motion, or a lens that the camera model does not describe, throws
// others off.
bool FreePrincipalPoints(StageContext& context, const ViewGraph& graph, bool is_earlier,
                         Reconstruction& model, std::vector<ResultWarning>& warnings);

// verify_again.cc
// Where bundle adjustment has moved the rays of cameras by more than verification's threshold: of
// pairs in use between their images, all matches that agree with the model's pose, if these are
// more than before.
struct ReverifiedPairs {
  std::map<image_pair_t, FeatureMatches> matches;
  int64_t num_gained = 0;  // matches
};
ReverifiedPairs VerifyAgain(StageContext& context, const Reconstruction& model,
                            const ViewGraph& graph);
// Where models moved the rays of cameras as far, these get their intrinsics, and their pairs poses
// by these. False: nowhere.
bool TakeIntrinsics(std::span<const Reconstruction> models, const RunContext& run,
                    SceneData& scene);
// Refines the model once more with these, if they bring many matches, and unless it would lose
// images by it. False: there is not enough memory, and the report has the failure.
bool RefineWithMovedIntrinsics(StageContext& context, const ViewGraph& graph,
                               Reconstruction& model);

// places.cc
// Throws ConfigError.
void CheckPlaceOptions(const PlaceOptions& places, const std::string& image_path,
                       const Database& database);
// nullptr: none are to be used.
std::shared_ptr<const KnownPositions> ReadPlaces(const Database& database, const SceneData& scene,
                                                 const PlaceOptions& places,
                                                 const std::string& image_path,
                                                 const RunContext& run);
// By the images' positions, for translation averaging of images with these rotations (cam from
// world), which the result refers to; nullptr: none are to be used.
CenterPriors PriorsOfCenters(const StageContext& context,
                             const std::map<image_t, Eigen::Quaterniond>& rotations);
// Adjusts a model, moved to where the known positions put it, with these as priors, until they
// agree no better. A model whose place they do not tell stays as it is.
void AdjustToPlaces(StageContext& context, Reconstruction& model);
// Moves finished models to east-north-up axes, and warns of what stays where it was.
void PlaceModels(const SceneData& scene, const RunContext& run, ReconstructResult& result);

// poses_alone.cc
// How far all relative poses, those that were filtered out among them, agree with the model.
void ReportAgreement(StageContext& context, const Reconstruction& model);

// checks.cc
// "" or why the model is not fit to be written.
std::string ReasonToRefuse(const Reconstruction& model);

// earlier_models.cc
// Models to go on from, the largest first: the poses and cameras of `models`, by the names of the
// images, without points. Images of the scene get the cameras that they share in the models. Says
// in the report what of the models is left out; it has the failure where nothing is left.
// Images whose photographs were replaced since are left to be registered, if others are at all.
std::vector<Reconstruction> AdoptModels(std::span<const Reconstruction> models, SceneData& scene,
                                        const ReconstructOptions& options, const RunContext& run,
                                        RunReport& report);

// movement.cc
// Puts a model that goes on from an earlier one where that was. Warns of images that moved by more
// than the confidence in their earlier poses, with the reason.
std::vector<ResultWarning> KeepFrame(StageContext& context, const Reconstruction& earlier,
                                     const std::map<image_t, PoseConfidence>& confidences,
                                     Reconstruction& model);

// colors.cc
// From the photographs. Returns why some gave none, a line each.
std::vector<std::string> ColorPoints(StageContext& context, const std::string& image_path,
                                     Reconstruction& model);

}  // namespace cairn
