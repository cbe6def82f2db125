#pragma once

#include <Eigen/Core>
#include <map>
#include <set>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/run_context.h"
#include "cairn/camera/camera.h"

namespace cairn {

// A focal length is far from another where it is off by more than so many standard deviations.
inline constexpr double kFarSigmas = 3;

struct FocalCalibrationOptions {
  bool enabled = true;
  int min_pairs = 2;
  int max_pairs = 100;
  double max_sigma = 0.1;
  double guess_sigma = 0.7;  // bundle adjustment has these two as priors, too
  double exif_sigma = 0.1;
  double min_exif_error = 0.15;
  double principal_point_sigma = 0.01;
  double min_fov_deg = 5.0;
  double max_fov_deg = 140.0;

  void VisitFields(OptionVisitor& v);
};

// The matches of two images that agree with one fundamental matrix.
struct FocalPair {
  camera_t camera_id1 = kInvalidCameraId;
  camera_t camera_id2 = kInvalidCameraId;
  Eigen::Matrix3d F;  // x2^T F x1 = 0, pixels; refined here
  std::vector<Eigen::Vector2d> pixels1, pixels2;
};

enum class FocalStatus : int {
  kCalibrated = 0,  // the focal length found replaces the one that was there
  kConfirmed,       // EXIF's focal length agrees with the pairs
  kTooFewPairs,
  kContradicted,  // fewer than half of the camera's pairs agree
  kUndetermined,  // parallel axes, planes, rotations: sigma is too large
  kImplausible,   // outside the range of fields of view
};
std::string_view FocalStatusName(FocalStatus status);

struct CalibratedFocal {
  FocalStatus status = FocalStatus::kTooFewPairs;
  double focal_before_px = 0;
  double focal_px = 0;  // found by the pairs, whether or not it is adopted
  double sigma = 0;     // relative standard deviation of focal_px
  int num_pairs = 0;
  int num_agreeing = 0;  // pairs
};

struct FocalCalibrationReport {
  // Cameras that took part, without those in `trusted`.
  std::map<camera_t, CalibratedFocal> cameras;
  int num_pairs = 0;           // whose fundamental matrix could be determined
  int num_pairs_agreeing = 0;  // with the focal lengths found
};

// Indices of the pairs to use, ascending: the ones with the most inliers until both of their
// cameras have max_pairs.
struct FocalPairCount {
  camera_t camera_id1 = kInvalidCameraId;
  camera_t camera_id2 = kInvalidCameraId;
  int num_inliers = 0;
};
std::vector<size_t> SelectFocalPairs(std::span<const FocalPairCount> pairs, int max_pairs);

// Focal lengths from fundamental matrices over the view graph: K2^T F K1 must have two equal
// singular values (Kruppa's equations; Sweeney, Sattler, Hoellerer, Turk, Pollefeys, "Optimizing
// the viewing graph for structure-from-motion", 2015; Fetzer, Reis, Stricker, "Stable intrinsic
// auto-calibration from fundamental matrices of devices with uncorrelated camera parameters",
// 2020). Both equations of a pair are weighed by the covariance that its matches, and an uncertain
// principal point, give them: parallel axes weigh nothing by themselves. Leave out planar pairs:
// any F of a plane is as good, and its noise looks certain. Geman and McClure's loss takes wrong
// pairs; one focal length a camera, however many images it took; cameras in `trusted` keep theirs.
// Levenberg-Marquardt over logarithms of focal lengths from several starts. Then they are refined
// on the matches: on the squared errors that the best essential matrices leave beyond those of F;
// standard deviations stay those of Kruppa's equations. Distortion is not modeled. The result does
// not depend on run.num_threads, nor on options.enabled and options.max_pairs, which are a
// reconstruction's. Throws ConfigError for a pair of a camera that is not there, or whose lens is
// wide (no plane holds its rays).
FocalCalibrationReport CalibrateFocals(const std::map<camera_t, Camera>& cameras,
                                       const std::set<camera_t>& trusted,
                                       std::span<const FocalPair> pairs,
                                       const FocalCalibrationOptions& options = {},
                                       const RunContext& run = {});

}  // namespace cairn
