#pragma once

#include "cairn/geometry/rigid3d.h"
#include "cairn/solvers/affine_frame.h"

namespace cairn {

// Relative pose from one affine correspondence with depth: Eichhardt and Barath, ECCV 2020, in the
// corrected form of src/solvers/README.md. Frames of view 1 map into view 2 by
//   a2 = scale R a1 + t,  A2 = scale R A1.
struct LiftedCorrespondence {
  LiftedFrame frame1;
  LiftedFrame frame2;
};

struct ScaledPose {
  // Translation in the unit of the second depth map: not normalized.
  Rigid3d cam2_from_cam1;
  // Unit of the second depth map over that of the first.
  double scale = 1.0;
};

// "Proposed": aligns two orthonormal frames that keep the second axis of the affine frames exactly.
// Returns the number of models: 0 if the frames are mirrored, singular, not in front of the camera,
// or give a scale <= 0.
struct OneAffineDepthProposed {
  static constexpr int kSampleSize = 1;
  static constexpr int kMaxSolutions = 1;
  using Sample = LiftedCorrespondence;
  using Model = ScaledPose;
  static int Solve(const Sample* samples, Model* models);
};

// "Umeyama": least squares over both axes by a singular value decomposition.
struct OneAffineDepthUmeyama {
  static constexpr int kSampleSize = 1;
  static constexpr int kMaxSolutions = 1;
  using Sample = LiftedCorrespondence;
  using Model = ScaledPose;
  static int Solve(const Sample* samples, Model* models);
};

}  // namespace cairn
