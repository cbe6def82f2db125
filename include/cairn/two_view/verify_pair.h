#pragma once

#include <Eigen/Core>
#include <span>

#include "cairn/base/run_context.h"
#include "cairn/camera/camera.h"
#include "cairn/two_view/pair_verifier.h"

namespace cairn {

// One image's side of the matches of two images: entry i of one corresponds to entry i of the
// other. What is not known is left empty.
struct MatchedPoints {
  const Camera& camera;                          // of the same id as the other: one camera
  std::span<const Eigen::Vector2d> points;       // pixels
  std::span<const Eigen::Matrix2d> frames = {};  // affine frames: the columns are axes in pixels
  std::span<const DepthSample> depths = {};      // in the image's own unit, not all need be valid
};

struct VerifyPairOptions {
  VerifierKind verifier = VerifierKind::kCascade;
  TwoViewOptions verification = {};
  // Better matches come first; otherwise their order tells nothing.
  bool are_best_first = false;
};

// The relative pose of two images from their matches, many of which may be wrong. `status` of the
// result is kVerified or the reason why there is none; `geometry` has the kind (config), the pose
// cam2_from_cam1 with |t| = 1 (absent where the kind has none), and the inliers as matches (i, i).
// Throws ConfigError that names what is wrong: sizes that differ, numbers that are not finite,
// frames without area, depths that are not positive, cameras or options that mean nothing.
// Coordinates are worth a float's precision. Runs on the calling thread. For many pairs of images
// with keypoints in common, MakePairVerifier saves the conversion.
PairReport VerifyPair(const MatchedPoints& image1, const MatchedPoints& image2,
                      const VerifyPairOptions& options = {}, const RunContext& run = {});

}  // namespace cairn
