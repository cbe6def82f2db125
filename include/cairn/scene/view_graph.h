#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/base/named_value.h"
#include "cairn/base/types.h"
#include "cairn/geometry/rigid3d.h"

namespace cairn {

// Why an edge was taken out of the view graph. Kept on the edge, so that it can be shown.
enum class EdgeRemoval : int {
  kNone = 0,  // The edge is in use.
  kTooFewInliers,
  kNoPose,                 // Verified, but without a relative pose (panoramic, watermark, ...).
  kTripletInconsistent,    // Rotation loops through it do not close.
  kRotationInconsistent,   // Disagrees with the global rotations.
  kDirectionInconsistent,  // 1DSfM: its translation direction contradicts the others.
  kOtherComponent,         // No model has both of its images.
  kAmbiguous,              // Contradicts many well-supported loops: duplicate structure.
  kModelInconsistent,      // The finished model explains less than half of its matches.
};

inline constexpr NamedValue<EdgeRemoval> kEdgeRemovals[] = {
    {EdgeRemoval::kNone, "in_use"},
    {EdgeRemoval::kTooFewInliers, "too_few_inliers"},
    {EdgeRemoval::kNoPose, "no_pose"},
    {EdgeRemoval::kTripletInconsistent, "triplet_inconsistent"},
    {EdgeRemoval::kRotationInconsistent, "rotation_inconsistent"},
    {EdgeRemoval::kDirectionInconsistent, "direction_inconsistent"},
    {EdgeRemoval::kOtherComponent, "other_component"},
    {EdgeRemoval::kAmbiguous, "ambiguous"},
    {EdgeRemoval::kModelInconsistent, "model_inconsistent"},
};

std::string_view EdgeRemovalName(EdgeRemoval removal);

// Who determined an edge's pose and inliers.
enum class EdgeSource : int {
  kVerified = 0,  // cairn's verification
  kOtherProgram,  // such as COLMAP: by intrinsics and a threshold that are not known
  kDataset,       // relative poses of a 1DSfM data set: inliers were not counted
};

// A verified pair, image_id1 < image_id2.
struct ViewEdge {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  Rigid3d cam2_from_cam1;  // |translation| = 1, or 0: the camera turned without moving
  int num_inliers = 0;
  double residual_px = 0;              // median Sampson error of the inliers, 0 if unknown
  double triangulation_angle_deg = 0;  // median over the inliers, 0 if unknown
  std::string verifier;                // the one that found the pose, "" if unknown
  EdgeSource source = EdgeSource::kVerified;
  EdgeRemoval removal = EdgeRemoval::kNone;

  bool IsActive() const { return removal == EdgeRemoval::kNone; }
  bool HasTranslation() const { return !cam2_from_cam1.translation.isZero(0); }
  image_pair_t PairId() const { return ImagePairToPairId(image_id1, image_id2); }
};

// Images and the verified pairs between them. Both vectors are sorted by id (edges by pair), so
// that every loop over them runs in the same order.
struct ViewGraph {
  std::vector<image_t> image_ids;
  std::vector<ViewEdge> edges;

  int NumActiveEdges() const;
  // Sorts and checks: ids ordered within an edge, no duplicate edge, every edge's images present.
  // Throws BugError.
  void Normalize();
};

}  // namespace cairn
