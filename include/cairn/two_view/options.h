#pragma once

#include "cairn/base/options.h"

namespace cairn {

// Options of two-view verification: `verification.*` in files and flags.
struct TwoViewOptions {
  double max_error_px = 0.0;  // DefaultMaxErrorPx
  double confidence = 0.99;
  int min_num_matches = 20;
  int min_num_inliers = 15;
  double min_log10_evidence = 6.0;  // a contrario (Moisan and Stival, 2004)
  // One standard deviation along the worst axis, for errors of a third of the threshold.
  double max_pose_sigma_deg = 15.0;
  double min_special_share = 0.8;
  double min_calibrated_share = 0.8;  // COLMAP has 0.95
  double min_competing_share = 0.5;
  bool detect_watermark = true;
  int max_iterations = 10000;
  int min_iterations = 100;
  double rough_error_factor = 3.5;
  int max_depth_triangles = 4096;
  int max_affine_samples = 300;
  int max_fallback_samples = 2000;
  double unsupported_budget = 0.1;  // of affine and five-point samples
  int num_resamples = 10;

  void VisitFields(OptionVisitor& v) {
    v.Double(
        "max_error_px", max_error_px, {0.0, 1000.0},
        "inlier threshold on the Sampson error, px; 0: 0.1 % of the image diagonal, at least 1");
    v.Double("confidence", confidence, {0.0, 0.999999999},
             "chance that the best model was found before seven-point sampling stops");
    v.Int("min_num_matches", min_num_matches, {5, 1e9}, "pairs with fewer matches are not tried");
    v.Int("min_num_inliers", min_num_inliers, {5, 1e9},
          "pairs with fewer inliers are never accepted");
    v.Double("min_log10_evidence", min_log10_evidence, {-300.0, 300.0},
             "acceptance needs support that chance gives less than once in 10^this pairs");
    v.Double("max_pose_sigma_deg", max_pose_sigma_deg, {0.0, 180.0},
             "pairs whose rotation is more uncertain are degenerate, translation: panoramic");
    v.Double("min_special_share", min_special_share, {0.0, 1.0},
             "share of inliers on one homography, rotation or shift of a special pair");
    v.Double("min_calibrated_share", min_calibrated_share, {0.0, 1.0},
             "E with a smaller share of F's inliers is wrong by its focal lengths");
    v.Double("min_competing_share", min_competing_share, {0.01, 10.0},
             "a second model with this share of the first one's support makes a pair ambiguous");
    v.Bool("detect_watermark", detect_watermark,
           "look under marks in the frame, or printed over photographs; pairs of marks alone get "
           "no pose");
    v.Int("max_iterations", max_iterations, {1, 1e9},
          "most five-point samples of a pair without affine frames, or by five_point");
    v.Int("min_iterations", min_iterations, {1, 1e9}, "fewest seven-point samples of a pair");
    v.Double("rough_error_factor", rough_error_factor, {1.0, 1000.0},
             "scale at which rough hypotheses are ranked and first refined, in thresholds");
    v.Int("max_depth_triangles", max_depth_triangles, {1, 1e9},
          "samples of three matches with depth of a pair");
    v.Int("max_affine_samples", max_affine_samples, {1, 1e9},
          "most samples of two affine correspondences of a pair");
    v.Int("max_fallback_samples", max_fallback_samples, {0, 1e9},
          "most five-point samples of a pair after the other steps of the cascade");
    v.Double("unsupported_budget", unsupported_budget, {0.0, 1.0},
             "share of the budgets for pairs whose affine frames do not support each other");
    v.Int("num_resamples", num_resamples, {0, 1e4},
          "five-point samples a round among the final model's inliers; 0: none");
  }
};

}  // namespace cairn
