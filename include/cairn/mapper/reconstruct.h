#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"
#include "cairn/bundle_adjustment/pose_confidence.h"
#include "cairn/database/database.h"
#include "cairn/intrinsics/focal_calibration.h"
#include "cairn/report/run_report.h"
#include "cairn/resection/resection.h"
#include "cairn/rotation_averaging/rotation_averaging.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/scene/view_graph.h"
#include "cairn/tracks/tracks.h"
#include "cairn/translation_averaging/options.h"
#include "cairn/triangulation/triangulation.h"
#include "cairn/view_graph/options.h"

namespace cairn {

// Cameras whose principal points, guessed at the image centers, may be adjusted: of photographs
// without a focal length in EXIF, which may be cropped or rectified, or all.
enum class PrincipalPointRefinement { kNone, kUnknown, kAll };
inline constexpr NamedValue<PrincipalPointRefinement> kPrincipalPointRefinements[] = {
    {PrincipalPointRefinement::kNone, "none"},
    {PrincipalPointRefinement::kUnknown, "unknown"},
    {PrincipalPointRefinement::kAll, "all"}};

struct ReconstructOptions {
  // Every connected component of the view graph becomes a model, the largest first; all but the
  // largest need this many images.
  int min_model_images = 3;
  int max_models = 50;
  // Tracks an image that join the camera-camera directions in translation averaging.
  int position_tracks_per_image = 200;
  // Rounds of triangulation, adjustment and filtering over all tracks.
  int max_rounds = 5;
  // An image with fewer points is taken out of the model.
  int min_image_points = 15;
  // Memory that the whole program may take; 0: what the machine has left when it is needed. Where
  // bundle adjustment would take more, it gets fewer tracks.
  double max_memory_gib = 0.0;
  bool register_left_out = true;
  bool share_camera = true;
  bool separate_duplicates = true;
  // Both where the matches agree better, by more than 1.6 standard errors; lenses of
  // cameras with EXIF by three standard errors.
  bool choose_lens_models = true;
  PrincipalPointRefinement refine_principal_points = PrincipalPointRefinement::kUnknown;
  bool colors = true;

  void VisitFields(OptionVisitor& v);
};

// What is known of places on Earth (georegistration/georegister.h), and what it is used for.
struct PlaceOptions {
  bool use_gps = false;
  std::string gps_path = {};
  std::string gcp_path = {};

  void VisitFields(OptionVisitor& v);
};

// The options of all stages.
struct ReconstructSettings {
  PlaceOptions places;
  ReconstructOptions reconstruct;
  FocalCalibrationOptions focal_calibration;
  ViewGraphBuilderOptions view_graph;
  RotationAveragingOptions rotation_averaging;
  TranslationAveragingOptions translation_averaging;
  TrackOptions tracks;
  TriangulationOptions triangulation;
  BundleAdjustmentOptions bundle_adjustment;
  ResectionOptions resection;
  // Focal lengths and distortions. Not set: constant for cameras that the user gave or that were
  // calibrated before (KnownIntrinsics::IsConstant), refined for the others.
  std::optional<bool> refine_intrinsics;

  // Calls visit(module, options) for each module's options, in order: for flags and validation.
  template <class Visit>
  void VisitModules(const Visit& visit) {
    visit("", places);
    visit("reconstruct", reconstruct);
    visit("focal_calibration", focal_calibration);
    visit("view_graph", view_graph);
    visit("rotation_averaging", rotation_averaging);
    visit("translation_averaging", translation_averaging);
    visit("tracks", tracks);
    visit("triangulation", triangulation);
    visit("bundle_adjustment", bundle_adjustment);
    visit("resection", resection);
  }
};

struct ReconstructResult {
  // Largest first. Where report.failure is not empty: none, or, of a run that the user stopped, as
  // far as they got.
  std::vector<Reconstruction> models;
  // Of the images of each model.
  std::vector<std::map<image_t, PoseConfidence>> confidences = {};
  // Of the verified matches of each model's images, how many agree with it; none where pairs have
  // no matches.
  std::vector<double> explained_shares;
  // Of each model, whether it goes on from an earlier one, and has its world frame.
  std::vector<bool> keeps_frame = {};
  std::vector<Image> images;  // all images of the database, by id
  ViewGraph graph;            // all verified pairs, with the reasons of those that were taken out
  RunReport report;
  // Of the models, JSON (see GeoregistrationToJson); "": its place is not known.
  std::vector<std::string> georegistrations = {};
  std::string page = {};  // text of report.html (see MakeReportPage); "": none is written
};

// View graph, rotation averaging, 1DSfM filter and translation averaging, tracks, triangulation,
// bundle adjustment with filtering and retriangulation, resection of images left out, colors from
// the photographs under image_path (skipped where they are absent; "": no colors; IoError where
// the folder is). Where the pairs
// have poses but no matches, the models are cameras alone: graph, rotations, translations. An
// expected failure is in report.failure; throws IoError where the database cannot be read,
// ConfigError, before any work, for an option out of range.
// With `earlier` models, of whichever program, their poses and cameras take the place of averaging
// and calibration: their images are told by name, points are triangulated anew, images that are not
// in them are registered (ReconstructOptions::register_left_out), and everything is refined. Their
// world frames stay (without PlaceOptions), and report.warnings names poses that moved by more than
// their confidence.
ReconstructResult Reconstruct(const Database& database, const std::string& image_path,
                              const ReconstructSettings& settings = {}, const RunContext& run = {},
                              std::span<const Reconstruction> earlier = {});

// Makes the folder, and removes what killed runs left in it. Throws ConfigError where a file that
// WriteReconstructResult would replace is not as cairn wrote it (unless `overwrites`): another
// program's work, or the user's; and where the folder has results of another command. Throws
// IoError where the folder cannot be written to.
void CheckReconstructOutput(const std::string& output_path, bool overwrites = false);

// Writes sparse/<k>/{cameras,images,points3D}.bin for every model (and georegistration.json),
// bundle.out with list.txt and points.ply of the largest, confidence.csv (a line an image: pairs in
// use, points, standard deviations of its pose; see EstimatePoseConfidence), the view graph as
// view_graph.json and view_graph.dot (Graphviz), report.json, effective.toml and report.html. All
// of it appears together, in place of an earlier run's files. Without models only the last five are
// written. Where an earlier run's models are, these stay with all that belongs to them after a
// failure, which is put into failed/. Adds what a format cannot hold to the report's messages.
// Returns the path of report.json. Throws as CheckReconstructOutput does.
std::string WriteReconstructResult(ReconstructResult& result, const std::string& output_path,
                                   const std::string& effective_toml, bool overwrites = false,
                                   const RunContext& run = {});

}  // namespace cairn
