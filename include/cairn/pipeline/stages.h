#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/run_context.h"
#include "cairn/database/database.h"
#include "cairn/depth/options.h"
#include "cairn/features/features.h"
#include "cairn/matching/matching.h"
#include "cairn/report/run_report.h"

namespace cairn {

class Helpers;  // the other processes of a job, of RunBuildPipeline

// The stages of build_view_graph up to matching. Each reads what it needs from the database, writes
// what is missing, and can be run again: rows that are there are reused, and a stage that was made
// with other options or from other inputs is an error (ConfigError) that names what differs. Rows
// of other programs (COLMAP) are taken as they are. An item that fails (a damaged photograph, a
// missing depth map) is recorded, reported by one Warning, and skipped. All return early, keeping
// what is done, when the monitor wants to stop; then report.WasStopped(). The rows that a stage
// writes do not depend on run.num_threads, nor on helpers, nor on whether it was interrupted.

struct CameraOptions {
  CameraModel camera_model = CameraModel::kSimpleRadial;
  std::vector<double> camera_params;
  bool single_camera = false;
  bool single_camera_per_folder = false;

  void VisitFields(OptionVisitor& v) {
    v.Choice(
        "camera_model", camera_model, NamedCameraModels(),
        "model of new cameras; without camera_params, panoramas of a whole sphere (by XMP) are "
        "EQUIRECTANGULAR");
    v.Doubles("camera_params", camera_params,
              "parameters of new cameras, in COLMAP's order; without, the focal length comes from "
              "EXIF, or is 1.2 times the larger side (fisheye models: 150 degrees across it)");
    v.Bool("single_camera", single_camera, "all images were taken by one camera");
    v.Bool("single_camera_per_folder", single_camera_per_folder,
           "all images of a sub-folder were taken by one camera");
  }
};

// The photographs of a folder, or those that a caller selects, perhaps with their focal lengths.
struct PhotoSource {
  struct Photo {
    std::string name;                // relative to the folder
    std::optional<double> focal_px;  // instead of EXIF's
  };
  std::string image_path;                                      // "": none
  std::optional<std::vector<Photo>> selection = std::nullopt;  // nullopt: all
  // Folders of masks and depth maps, none of them photographs ("": none).
  std::vector<std::string> other_paths = {};
  // Images that were imported from a folder (all of it) that no longer has them leave the database.
  bool drop_missing = false;
  // Images whose photographs changed are forgotten, and the photographs added as new ones.
  bool recompute_changed = false;
};

// Adds the photographs of the source that the database does not have, with their cameras, in the
// order of their names. Cameras as COLMAP 3.8 makes them: one for all (single_camera) or for a
// sub-folder (single_camera_per_folder), else one for all images with equal EXIF make, model, focal
// length and size, else one an image; photographs that join later share the cameras of those that
// are there. Throws IoError when the folder cannot be read or neither it nor the database has an
// image, ConfigError where drop_missing would leave none of the folder's images, or a photograph
// changed and recompute_changed is not set.
StageReport ImportPhotos(Database& database, const PhotoSource& source,
                         const CameraOptions& options = {}, const RunContext& run = {});

// The photographs that features are found in.
struct FeatureSource {
  std::string image_path;      // "": nothing can be computed, images without keypoints are counted
  std::string mask_path = {};  // folder of masks, `<image name>.png` ("": none), as COLMAP has them
};

// Features of every image without keypoints. An image that cannot be decoded leaves the database.
// No features are where the image's mask is 0 (black); images without a mask are named. An image
// whose mask changed since cairn found its features, or came, gets new ones; the pairs that it had
// are forgotten. Throws ConfigError for a mask that has not the size of its photograph.
StageReport ExtractImageFeatures(Database& database, const FeatureSource& source,
                                 const FeatureOptions& options = {}, const RunContext& run = {},
                                 Helpers* helpers = nullptr);

// Where depth comes from; at most one of the two (RunBuildPipeline checks them).
struct DepthSource {
  std::string depth_path;   // a folder of depth maps, `<image name>.npy` ...
  std::string depth_model;  // an ONNX network, run on the photographs
};
// Depth and its gradient at the keypoints of every image without depth samples. Where an image had
// none when its pairs were verified, what verification found of them is forgotten. Samples stay
// where their map or photograph is gone. Without a source, nothing.
StageReport SampleImageDepth(Database& database, const std::string& image_path,
                             const DepthSource& source, const DepthOptions& options = {},
                             const RunContext& run = {});

// What the stages over pairs may use; the memory is for features and matches that are loaded at
// once.
struct SchedulerOptions {
  double max_memory_gib = 2.0;

  void VisitFields(OptionVisitor& v) {
    v.Double("max_memory_gib", max_memory_gib, {0.001, 1e6},
             "memory for the features and matches that are loaded at once, GiB");
  }
};

// Pairs of images by name, two a line; a line that begins with '#' is a comment. Lines with a name
// that the database does not have are reported by Warning and left out. Ascending by pair id.
// Throws IoError with file and line.
std::vector<image_pair_t> ReadPairList(const std::string& path, const std::vector<Image>& images,
                                       ProgressMonitor& monitor = NullMonitor());

struct PairsToMatch {
  std::vector<image_pair_t> pairs;  // ascending
  SchedulerOptions scheduler = {};
};

// Matches of the given pairs where they are missing. Images of these pairs whose descriptors
// changed since they were matched are an error.
StageReport MatchImagePairs(Database& database, const PairsToMatch& wanted,
                            const MatchingOptions& options = {}, const RunContext& run = {},
                            Helpers* helpers = nullptr);

}  // namespace cairn
