#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "cairn/base/types.h"
#include "cairn/geometry/rigid3d.h"

namespace cairn {

// Rows of cairn's own tables.

// cairn_pair_metrics: what one verifier found for one pair. Key: (pair_id, verifier).
struct PairMetrics {
  image_pair_t pair_id = 0;
  std::string verifier;    // the verifier that was run: "one_ac_depth", "five_point", ...
  std::string status;      // PairStatusName: "verified", "no_model", ...
  bool is_winner = false;  // its result is the pair's row in two_view_geometries
  std::string step;        // the step that decided, for a verifier with several; else as `verifier`
  int num_matches = 0;
  int num_inliers = 0;
  int64_t num_iterations = 0;
  double score = 0;
  double residual_px = 0;
  double triangulation_angle_deg = 0;
  std::optional<Rigid3d> cam2_from_cam1;  // where status is "verified" and a pose is known
};

// cairn_focal_evidence: of the matches of a pair that affine frames bear out, those that E
// explains, at trusted focal lengths, and those that F does. Key: pair_id.
struct PairFocalEvidence {
  image_pair_t pair_id = 0;
  int num_matches = 0;
  int num_by_essential = 0;
  int num_by_fundamental = 0;
};

// A camera of a model that cairn does not have: a later COLMAP's, or a damaged row.
struct UnknownCamera {
  camera_t camera_id = kInvalidCameraId;
  int64_t model_id = -1;
  int width = 0;  // pixels
  int height = 0;
};

// cairn_camera_focals: what its pairs say of a camera's trusted focal length. Key: camera_id.
struct CameraFocal {
  bool is_refuted = false;  // its pairs are verified as though it was not trusted
  int num_pairs = 0;        // with evidence
  int num_refuting = 0;
};

// cairn_camera_lenses: what its pairs taught about a camera whose lens, or focal length, nothing
// had told before; it stands beside the camera's row, which stays as it was given. Key: camera_id.
struct CameraLens {
  double focal_px = 0;          // 0: nothing was learned, the camera's own holds
  double focal_sigma = 0;       // relative standard deviation
  bool is_focal_known = false;  // well enough for pairs to be verified with it as with EXIF's
  double k = 0;                 // SIMPLE_RADIAL's, at the focal length that holds; 0: none
  double k_sigma = 0;
  int num_pairs = 0;  // likely pairs that the camera had, used or not

  bool IsEmpty() const { return focal_px == 0 && k == 0; }
  bool operator==(const CameraLens&) const = default;
};

// cairn_photos: a file of the image folder, and what became of it. Key: name.
struct PhotoRecord {
  std::string name;        // relative to the image folder
  uint64_t file_hash = 0;  // of the file's bytes
  std::string error;       // "": in use; else why it was skipped, and it has no row in `images`
};

// cairn_jobs: an item (an image or a pair id) that a stage has finished, and a hash of all that its
// result was made from, options apart. Key: (stage, item).
struct JobRecord {
  uint64_t item = 0;
  uint64_t input_hash = 0;
  // "" or a note: "given" for rows that came from elsewhere, or why the item has no result.
  std::string note;
};

// cairn_stages: a stage that was begun. Key: stage.
struct StageRecord {
  std::string stage;
  std::string options;      // TOML lines of all options that its results depend on
  uint64_t input_hash = 0;  // of options and all jobs; 0 while the stage is not complete
  bool is_complete = false;

  std::map<std::string, std::string> OptionValues() const;  // by key
};

}  // namespace cairn
