#pragma once

#include <Eigen/Core>
#include <map>
#include <set>
#include <span>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/intrinsics/focal_calibration.h"
#include "intrinsics/shared_lenses.h"

namespace cairn {

// Two images' matches, right and wrong, with a fundamental matrix that explains some of them.
struct DistortionPair {
  camera_t camera_id1 = kInvalidCameraId;
  camera_t camera_id2 = kInvalidCameraId;
  Eigen::Matrix3d F;  // x2^T F x1 = 0 of rays (third component 1), by the cameras as they are
  std::vector<Eigen::Vector2d> pixels1, pixels2;
  // A plane's or a rotation's F is one of many: it tells distortion, but no focal length.
  bool tells_focal = true;
};

struct CalibratedDistortion {
  // The first radial coefficient (COLMAP's SIMPLE_RADIAL k), at the focal length that the camera
  // has, and its standard deviation. k (f' / f)^2 is the same lens at a focal length f'.
  double k = 0;
  double sigma = 0;
  // What k saves in the description of the matches' errors, against k = 0, beyond what systematic
  // errors would give; and what it takes to write it down. Both in nats.
  double gain = 0;
  double cost = 0;
  int num_pairs = 0;
  int num_matches = 0;          // explained
  bool is_significant = false;  // it saves more than it takes
};

struct DistortionCalibrationReport {
  std::map<camera_t, CalibratedDistortion> cameras;  // those that took part
  // The pairs by these distortions, for CalibrateFocals: what the refined fundamental matrices
  // explain, in the pixels of the same cameras without distortion. Those of too few, and those
  // that tell no focal length, are left out.
  std::vector<FocalPair> pairs;
};

// Whether k can be estimated: a model with radial coefficients of the pinhole family, all of them
// 0.
bool CanCalibrateDistortion(const Camera& camera);

// One radial distortion parameter a lens from fundamental matrices, without any focal length: the
// matches of all pairs of a camera must lie on epipolar lines when they are undistorted
// (Fitzgibbon, "Simultaneous linear estimation of multiple view geometry and lens distortion", CVPR
// 2001; here by robust least squares over all pairs). What a fundamental matrix explains without
// distortion lies near the image's middle, so a scan over k with a wide threshold collects matches
// anew, from k = 0 outwards; the best is refined over all cameras together, each F eliminated.
// Whether distortion is taken is a matter of description length: its parameter costs half the
// logarithm of the number of matches, systematic errors of a tenth of the noise are not attributed
// to the lens, and the gain is divided by what the scatter of the pairs exceeds that noise. Cameras
// in `constant` keep theirs. The result does not depend on run.num_threads.
DistortionCalibrationReport CalibrateDistortion(const std::map<camera_t, Camera>& cameras,
                                                const std::set<camera_t>& constant,
                                                const SharedLenses& shared,
                                                std::span<const DistortionPair> pairs,
                                                const RunContext& run = {});

}  // namespace cairn
