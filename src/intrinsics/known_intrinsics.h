#pragma once

#include <map>
#include <optional>

#include "cairn/camera/camera.h"
#include "cairn/database/database.h"

namespace cairn {

// All that is known of a camera's intrinsics: the database's row, what verification learned of the
// lens, and the verdict of the camera's pairs on its prior focal length.
struct KnownIntrinsics {
  Camera camera;  // with what was learned; has_prior_focal_length is the database's
  std::optional<CameraLens> lens;        // absent: not learned yet
  std::optional<CameraFocal> judgement;  // likewise
  bool is_given = false;                 // by --camera_params

  bool HasLearned() const { return lens && !lens->IsEmpty(); }
  // Given, from EXIF, or learned as precisely as that.
  bool HasPriorFocal() const {
    return camera.has_prior_focal_length || (lens && lens->is_focal_known);
  }
  // The camera's pairs contradict its prior focal length.
  bool IsRejected() const { return judgement && judgement->is_rejected; }
  // Essential matrices are searched with this focal length.
  bool IsFocalTrusted() const { return HasPriorFocal() && !IsRejected(); }
  // Bundle adjustment keeps them: given, or measured (LooksMeasured) and not rejected.
  bool IsConstant() const;
};

// The camera with the focal length and the distortion that were learned.
void ApplyLens(const CameraLens& lens, Camera& camera);

// COLMAP rounds the center of an odd size down in some versions.
bool IsCentered(const Camera& camera);
// A principal point off the image's center, two different focal lengths, or distortion: neither
// EXIF nor a guess gives these.
bool LooksMeasured(const Camera& camera);

// The cameras of known models.
std::map<camera_t, KnownIntrinsics> ReadKnownIntrinsics(const Database& database);

}  // namespace cairn
