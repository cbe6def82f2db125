#pragma once

#include <map>
#include <set>
#include <string>

#include "cairn/base/options.h"
#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// The size of undistorted images; names and meaning are those of COLMAP's image_undistorter, but
// for center_principal_point.
struct UndistortOptions {
  double blank_pixels = 0;
  double min_scale = 0.2;
  double max_scale = 2.0;
  int max_image_size = -1;
  bool center_principal_point = false;

  void VisitFields(OptionVisitor& v) {
    v.Double("blank_pixels", blank_pixels, {0, 1},
             "0: crop to what the photograph fills; 1: keep all of the photograph, with black "
             "beyond it; between: in between");
    v.Double("min_scale", min_scale, {1e-3, 1e3}, "smallest size, of the photograph's");
    v.Double("max_scale", max_scale, {1e-3, 1e3}, "largest size, of the photograph's");
    v.Int("max_image_size", max_image_size, {-1, 32766},
          "longer side, px, to which larger images are reduced; -1 or 0: no limit");
    v.Bool(
        "center_principal_point", center_principal_point,
        "undistorted images have their principal point at the center, where Bundler's format has "
        "it; those of 3dgs always have it there, since trainers of Gaussian splatting assume so");
  }
};

// The PINHOLE camera that undistorted images of a camera have: its focal lengths (fisheye models:
// as many pixels a radian at the center), its principal point at the same part of the image (or at
// the center), and a size such that the photograph's border is met as `blank_pixels` wants it.
// Parts of the border that no pinhole image shows (90 degrees and more off axis, or where
// distortion folds the image over) are infinitely far; max_scale decides then, and what the rest
// fills. Throws ConfigError for a panorama, which no pinhole image holds.
Camera UndistortedCamera(const Camera& camera, const UndistortOptions& options);

// The model as undistorted images of the given names see it: PINHOLE cameras with the ids they had,
// poses and points as they were. Keypoints that have no undistorted pixel, images that are not
// named, cameras without images, and points with fewer than two observations are left out.
Reconstruction UndistortedModel(const Reconstruction& model, const std::set<std::string>& names,
                                const UndistortOptions& options, const RunContext& run = {});

enum class DenseLayout { kColmap, kGaussianSplatting };
inline constexpr NamedValue<DenseLayout> kDenseLayouts[] = {
    {DenseLayout::kColmap, "colmap"}, {DenseLayout::kGaussianSplatting, "3dgs"}};

struct UndistortJob {
  std::string image_path;  // the photographs
  std::string output_path;
  std::string model_path = {};  // where the model was read from; "": nowhere that matters
  DenseLayout layout = DenseLayout::kColmap;
  bool overwrites = false;          // also files that this function did not write
  std::string effective_toml = {};  // written beside the results, if it is not empty
};

struct UndistortReport {
  int num_written = 0;
  int num_kept = 0;                           // of an earlier run, from the same photograph
  std::map<std::string, std::string> failed;  // by image name: why
  bool was_stopped = false;                   // a later call continues
};

// Undistorts the photographs of a model, to output_path/images. Once all are there, writes the
// model of those that did not fail, as binary COLMAP model:
// - kColmap: sparse/, and stereo/ with patch-match.cfg (all images, 20 sources each, chosen by
//   COLMAP), fusion.cfg and empty folders: what COLMAP's patch_match_stereo and OpenMVS read;
// - kGaussianSplatting: sparse/0/: what trainers of 3D Gaussian splatting read; images of folders
//   are in images/ itself, with "_" in place of "/" in their names. Principal points are centered:
//   the original trainer (Kerbl et al. 2023) reads the focal lengths alone.
// Every file appears complete or not at all. Images that an earlier call finished are kept if the
// photograph's bytes, both cameras and the image itself are as they were; images that are no longer
// in the model are removed, and a model is only there while its images are. Nothing that others
// wrote is replaced (ConfigError), unless job.overwrites; the model at job.model_path and results
// of reconstruct never are. A folder output_path/images with photographs of the model is refused,
// too (ConfigError). Throws IoError where the output cannot be written. Parallel
// over images; each takes some three times its decoded size in memory. Bytes do not depend on the
// number of threads.
UndistortReport UndistortImages(const Reconstruction& model, const UndistortJob& job,
                                const UndistortOptions& options, const RunContext& run = {});

}  // namespace cairn
