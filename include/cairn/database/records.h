#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "cairn/base/types.h"
#include "cairn/geometry/rigid3d.h"

namespace cairn {

// Rows of cairn's own tables.

// cairn_pair_metrics: the result of one verifier for one pair. Key: (pair_id, verifier).
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

// cairn_focal_evidence: among the matches of a pair that have votes of affine frames, those that E
// explains at the prior focal lengths, and those that F explains; all 0: the pair was looked at and
// is no evidence. Key: pair_id.
struct PairFocalEvidence {
  image_pair_t pair_id = 0;
  int num_matches = 0;
  int num_by_essential = 0;
  int num_by_fundamental = 0;
};

// A camera of an unknown model: of a later COLMAP, or a damaged row.
struct UnknownCamera {
  camera_t camera_id = kInvalidCameraId;
  int64_t model_id = -1;
  int width = 0;  // pixels
  int height = 0;
};

// cairn_camera_focals: the verdict of a camera's pairs on its prior focal length. Key: camera_id.
struct CameraFocal {
  bool is_rejected = false;  // rejected: its pairs are verified as without a prior
  int num_pairs = 0;         // with evidence
  int num_contradicting = 0;

  bool operator==(const CameraFocal&) const = default;
};

// cairn_camera_lenses: lens and focal length of a camera for which they were unknown, as its pairs
// determine them. The camera's own row stays as it was given. Key: camera_id.
struct CameraLens {
  double focal_px = 0;          // 0: not learned, the camera's own is in force
  double focal_sigma = 0;       // relative standard deviation
  bool is_focal_known = false;  // well enough to be used like one from EXIF
  double k = 0;                 // SIMPLE_RADIAL's, at the focal length in force; 0: none
  double k_sigma = 0;
  int num_pairs = 0;  // likely pairs that the camera had, used or not

  bool IsEmpty() const { return focal_px == 0 && k == 0; }
  bool operator==(const CameraLens&) const = default;
};

// cairn_photos: a file of the image folder, and why it was skipped, if it was. Key: name.
struct PhotoRecord {
  std::string name;        // relative to the image folder
  uint64_t file_hash = 0;  // of the file's bytes
  std::string error;       // "": in use; else why it was skipped, and it has no row in `images`
};

// cairn_pair_choices: why a pair was given to matching. Key: pair_id.
struct PairChoiceRecord {
  image_pair_t pair_id = 0;
  int round = 0;       // rounds count on where photographs join later
  std::string reason;  // kPairReasons (pair_selection): "sequential", "retrieval", ...
  bool operator==(const PairChoiceRecord&) const = default;
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
  std::string options;  // TOML lines of all options that its results depend on
  bool is_complete = false;

  std::map<std::string, std::string> OptionValues() const;  // by key
};

}  // namespace cairn
