#pragma once

#include <Eigen/Core>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// Robust loss on the reprojection error.
enum class ReprojectionLoss { kNone, kSoftL1, kHuber, kCauchy };
inline constexpr NamedValue<ReprojectionLoss> kReprojectionLosses[] = {
    {ReprojectionLoss::kNone, "none"},
    {ReprojectionLoss::kSoftL1, "soft_l1"},
    {ReprojectionLoss::kHuber, "huber"},
    {ReprojectionLoss::kCauchy, "cauchy"}};

enum class BundleSolver {
  // Equal for any number of threads: cairn's own where rotations, positions and points are
  // adjusted, else Ceres by one thread.
  kAuto,
  kDenseSchur,  // Ceres, as the following; with several threads, last digits differ
  kSparseSchur,
  kIterativeSchur,
};
inline constexpr NamedValue<BundleSolver> kBundleSolvers[] = {
    {BundleSolver::kAuto, "auto"},
    {BundleSolver::kDenseSchur, "dense_schur"},
    {BundleSolver::kSparseSchur, "sparse_schur"},
    {BundleSolver::kIterativeSchur, "iterative_schur"}};

struct BundleAdjustmentOptions {
  ReprojectionLoss loss = ReprojectionLoss::kCauchy;
  // Error at which the loss leaves the square, in standard deviations of the observation (see
  // RegisteredImage::sigmas_px).
  double loss_scale = 2.0;
  int max_iterations = 50;
  // Stop when the relative change of the cost in one iteration is below. On photographs, 1e-6 takes
  // three times the iterations and changes AUC@1 by 0.02 at most.
  double function_tolerance = 1e-4;
  BundleSolver solver = BundleSolver::kAuto;

  void VisitFields(OptionVisitor& v);
};

// What is known of a camera beforehand. Each free parameter is one more observation, in standard
// deviations as the others are: a camera with few points stays near its prior, and one with many
// points is determined by these.
struct IntrinsicsPrior {
  std::vector<double> params;  // expected Camera::params
  double focal_sigma = 0;  // standard deviation of the focal length's logarithm; of fx / fy: 1 %
  double principal_point_sigma_px = 0;  // 0: it is constant
};

// Where something is, as told by other means than the images.
struct PositionPrior {
  Eigen::Vector3d position;   // world
  Eigen::Vector3d precision;  // 1 / standard deviation along each axis; 0: not known along it
};

// A point whose place was measured, and where images show it (with a standard deviation of a
// pixel). It is no point of the reconstruction.
struct SurveyedPoint {
  PositionPrior prior;
  std::map<image_t, Eigen::Vector2d> pixels;
};

// What is adjusted; everything else is constant.
struct BundleAdjustmentScope {
  bool rotations = true;
  bool positions = true;
  bool points = true;
  bool focal_lengths = false;
  bool distortions = false;
  bool principal_points = false;               // of cameras with a prior of it
  std::set<camera_t> fixed_cameras;            // constant intrinsics, whatever the flags above
  std::set<image_t> fixed_images;              // constant poses
  std::map<camera_t, IntrinsicsPrior> priors;  // none: nothing is known of a camera
  // Of camera centers, each with Huber's loss from the length on that 1 in 20 normal errors exceed:
  // a wrong one pulls no harder than that. They give the world its frame.
  std::map<image_t, PositionPrior> image_positions;
  std::vector<SurveyedPoint> surveyed_points;  // with the same loss, on their images, too
};

enum class BundleAdjustmentStatus : int {
  kConverged = 0,
  kMaxIterations,   // still improving; the result is usable
  kNoObservations,  // nothing to adjust
  kFailed,          // the solver failed, or has nothing to begin with (see `fault`); the
                    // reconstruction is unchanged
  kStopped,         // the user asked to stop; the reconstruction is as far as it got
};
std::string_view BundleAdjustmentStatusName(BundleAdjustmentStatus status);

struct BundleAdjustmentReport {
  BundleAdjustmentStatus status = BundleAdjustmentStatus::kNoObservations;
  std::string fault;  // the first value that cannot be adjusted, in words; "": none
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  int num_iterations = 0;
  // Root mean squared residual after the robust loss, in standard deviations.
  double initial_rmse = 0;
  double final_rmse = 0;
  double seconds = 0;
};

// Minimizes the robust reprojection error, weighed by the observations' precision, over `scope`:
// Levenberg-Marquardt, analytic Jacobians, points eliminated first (Schur complement; Triggs et
// al., "Bundle adjustment - a modern synthesis", 2000). The seven degrees of freedom of the world
// frame are free (but for what positions tell), since fixing some of them slows convergence; the
// damping keeps them bounded. Observations that are behind their camera at the start are left out.
// A prior's distortion coefficients have the standard deviation with which each alone would move a
// corner of the image as far as lenses differ: from the pinhole's projection to the equidistant one
// (a fisheye's), and by 3 % of the radius at any field of view. The reconstruction is changed in
// place: it may be large. The result does not depend on run.num_threads, but with a solver of Ceres
// that the user chose (BundleSolver): with several threads, the order of its sums, and so the last
// digits, differ from run to run. Throws ConfigError for options out of range, and where parts of
// the reconstruction do not fit together. Ids of the scope that it does not have are ignored, but
// those of images that show surveyed points.
BundleAdjustmentReport AdjustBundle(Reconstruction& reconstruction,
                                    const BundleAdjustmentScope& scope = {},
                                    const BundleAdjustmentOptions& options = {},
                                    const RunContext& run = {});

}  // namespace cairn
