#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "cairn/camera/camera.h"
#include "cairn/scene/features.h"
#include "cairn/scene/two_view_geometry.h"
#include "cairn/two_view/options.h"

namespace cairn {

// Everything that the verification of one pair depends on: its result is a pure function of this
// and the options.
struct PairInput {
  image_pair_t pair_id = 0;  // Seeds the pair's random numbers, together with `seed`.
  uint64_t seed = 0;
  const Camera* camera1 = nullptr;
  const Camera* camera2 = nullptr;
  std::span<const Keypoint> keypoints1;  // of the whole image; matches index into it
  std::span<const Keypoint> keypoints2;
  std::span<const DepthSample> depth1;  // one per keypoint, or empty: the image has no depth
  std::span<const DepthSample> depth2;
  std::span<const FeatureMatch> matches;
  // Better matches come first, as MatchDescriptors gives them; otherwise their order tells nothing.
  bool are_best_first = false;
  // Test the prior focal lengths of this pair: fills PairReport::focal_evidence.
  bool weigh_focals = false;
};

enum class PairStatus : int {
  kVerified = 0,
  kTooFewMatches,  // below TwoViewOptions::min_num_matches: not tried
  kNoDepth,        // the 1AC+D verifier had no correspondence with depth in both images
  kNoModel,        // no hypothesis survived
  kTooFewInliers,  // the best model has too few inliers, or no more than chance gives
  kDegenerate,     // an inlier set that fixes no pose (all points in one spot, ...)
};
std::string_view PairStatusName(PairStatus status);

// Among the matches that affine frames of neighboring matches predict, those that the essential
// matrix explains, and those that the best fundamental matrix explains: equally many, if the focal
// lengths are right.
struct FocalEvidence {
  int num_matches = 0;
  int num_by_essential = 0;
  int num_by_fundamental = 0;  // not fewer
};

// The result of one verifier.
struct PairReport {
  PairStatus status = PairStatus::kNoModel;
  // Filled when status is kVerified; cam2_from_cam1 has |t| = 1.
  TwoViewGeometry geometry;
  std::string_view verifier;  // name of the verifier (of the winning step, in a cascade); always
  int num_inliers = 0;
  int64_t num_iterations = 0;  // hypotheses generated
  double score = 0;            // robust support, larger is better; comparable between verifiers
  double residual_px = 0;      // median Sampson error of the inliers
  double triangulation_angle_deg = 0;  // median over what the pose explains
  // Many matches lie just outside the threshold of an accepted model: the focal lengths may be
  // wrong.
  bool may_have_wrong_focal = false;
  // Where it was asked for, both cameras have a prior focal length, and the pair has a pose by
  // them.
  std::optional<FocalEvidence> focal_evidence;
};

// Verifies pairs one after the other. Owns its scratch memory, so use one instance a thread.
class PairVerifier {
 public:
  virtual ~PairVerifier() = default;
  virtual PairReport Verify(const PairInput& input) = 0;
};

enum class VerifierKind {
  // 1AC+D, then three matches with depth, two affine frames, five points, each only while evidence
  // is missing; without frames (all shapes are the identity) the second and the last, by the full
  // budget.
  kCascade,
  kFast,        // 1AC+D, then two affine frames
  kOneAcDepth,  // one affine correspondence with depth a hypothesis: every match gives one
  kTwoAc,       // two affine correspondences without depth
  kFivePoint,   // five points a sample, locally optimized
};
std::string_view VerifierKindName(VerifierKind kind);  // "cascade", "fast", ...
// Throws ConfigError for an unknown name.
VerifierKind VerifierKindFromName(std::string_view name);

// Throws ConfigError for options out of range.
std::unique_ptr<PairVerifier> MakePairVerifier(VerifierKind kind, const TwoViewOptions& options);

}  // namespace cairn
