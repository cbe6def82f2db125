#include "cairn/mapper/reconstruct.h"

#include <algorithm>
#include <iterator>

#include "base/memory.h"
#include "cairn/base/timer.h"
#include "cairn/image/image_folder.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

void ColorModels(const SceneData& scene, const std::string& image_path,
                 const ReconstructSettings& settings, const RunContext& run,
                 ReconstructResult& result) {
  StageContext context{scene, settings, run, result.report};
  std::vector<std::string> skipped;
  for (Reconstruction& model : result.models) {
    if (!model.points3D.empty()) {
      std::ranges::move(ColorPoints(context, image_path, model), std::back_inserter(skipped));
    }
    ++context.model;
  }
  if (skipped.empty()) return;
  result.report.warnings.push_back(
      {std::to_string(skipped.size()) + " photographs gave no colors: " + skipped.front(),
       "is --image_path the folder of the database's photographs?"});
}

}  // namespace

void PlaceOptions::VisitFields(OptionVisitor& v) {
  v.Bool("use_gps", use_gps,
         "positions of the photographs, of gps_path, or else of the EXIF at image_path and of the "
         "database, are weak priors of translation averaging and bundle adjustment, so that long "
         "strips do not bend; models are in east, north, up, meters");
  v.String("gps_path", gps_path,
           "file with name,latitude,longitude[,altitude[,sigma]] a line, instead of GPS in EXIF");
  v.String("gcp_path", gcp_path,
           "ground control points, OpenDroneMap's gcp_list.txt: constraints of bundle adjustment "
           "in place of GPS, and checks (names that begin with CHK-); models are in meters, too");
}

void ReconstructOptions::VisitFields(OptionVisitor& v) {
  v.Int("min_model_images", min_model_images, {2, 1000000},
        "images that a model needs; the largest component is always tried");
  v.Int("max_models", max_models, {1, 1000000}, "largest number of models");
  v.Int("position_tracks_per_image", position_tracks_per_image, {0, 1000000},
        "tracks an image whose rays join translation averaging");
  v.Int("max_rounds", max_rounds, {1, 1000},
        "rounds of triangulation, adjustment and filtering over all tracks");
  v.Int("min_image_points", min_image_points, {3, 1000000},
        "an image with fewer points is removed");
  v.Double("max_memory_gib", max_memory_gib, {0, 1e6},
           "memory of the whole program; where bundle adjustment would take more, it gets fewer "
           "tracks; 0: what the machine has left");
  v.Bool("register_left_out", register_left_out,
         "try images that were left out again, by resection");
  v.Bool("share_camera", share_camera,
         "try one camera for images of one size that have a camera each, of the same prior focal "
         "length or none, if they are most");
  v.Bool("separate_duplicates", separate_duplicates,
         "detect duplicate structure, places that look alike, and reconstruct them separately");
  v.Bool("choose_lens_models", choose_lens_models,
         "give SIMPLE_RADIAL cameras with eight photographs and more a second parameter of "
         "distortion, where the matches agree better with it by more than chance gives once in "
         "twenty times: RADIAL, or RADIAL_FISHEYE for a lens that bends much");
  v.Choice("refine_principal_points", refine_principal_points, kPrincipalPointRefinements,
           "cameras whose principal points, guessed at the image centers, are moved as far as the "
           "matches are sure of it (against focal_calibration.principal_point_sigma), of cameras "
           "with eight photographs and more; unknown: without a focal length in EXIF");
  v.Bool("colors", colors, "color the points from the photographs");
}

ReconstructResult Reconstruct(const Database& database, const std::string& image_path,
                              const ReconstructSettings& settings, const RunContext& run,
                              std::span<const Reconstruction> earlier) {
  ReconstructSettings(settings).VisitModules(
      [](const char* module, auto& options) { ValidateOptions(options, module); });
  if (!image_path.empty()) CheckImageFolder(image_path);
  CheckPlaceOptions(settings.places, image_path, database);
  const Timer timer;
  RunReport read;
  SceneData scene = ReadSceneData(database, settings, run, read);
  ReconstructResult result;
  if (read.Succeeded()) {
    scene.places = ReadPlaces(database, scene, settings.places, image_path, run);
    result = ReconstructParts(earlier, settings, run, scene);
    PlaceModels(scene, run, result);
  } else {
    result.report.failure = read.failure;
  }
  const bool was_stopped = run.monitor.StopRequested();
  if (settings.reconstruct.colors && !image_path.empty() && !was_stopped) {
    ColorModels(scene, image_path, settings, run, result);
  }
  for (const Reconstruction& model : result.models) {
    result.confidences.push_back(EstimatePoseConfidence(model, run));
  }
  if (was_stopped) {
    result.report.failure = "stopped by the user; run again to reconstruct" +
                            std::string(result.models.empty() ? "" : "; models are unfinished");
  }
  for (const auto& [id, image] : scene.images) result.images.push_back(image);
  RunReport& report = result.report;
  report.program = "global_sfm reconstruct";
  report.seed = run.seed;
  report.num_threads = run.num_threads;
  report.stages.insert(report.stages.begin(), read.stages.begin(), read.stages.end());
  report.warnings.insert(report.warnings.begin(), read.warnings.begin(), read.warnings.end());
  size_t num_registered = 0;
  for (const Reconstruction& model : result.models) num_registered += model.images.size();
  report.values = {{"images", static_cast<double>(scene.images.size())},
                   {"registered", static_cast<double>(num_registered)},
                   {"models", static_cast<double>(result.models.size())},
                   {"seconds", timer.Seconds()},
                   {"peak_memory_gib", BytesToGib(std::max<int64_t>(0, ReadMemoryUse().peak))}};
  return result;
}

}  // namespace cairn
