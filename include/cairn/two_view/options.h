#pragma once

#include <string>

#include "cairn/base/options.h"

namespace cairn {

// Options of two-view verification: `verification.*` in files and flags.
struct TwoViewOptions {
  // Inlier threshold on the Sampson error, pixels; 0: 0.05 % of the mean image diagonal, as in the
  // paper (METHOD.md section 4), but at least 1 px, what a keypoint's position is worth.
  double max_error_px = 0.0;
  // Chance that the best model was found before sampling stops.
  double confidence = 0.99;
  // Pairs with fewer matches are not tried.
  int min_num_matches = 20;
  // A pair with fewer inliers is never accepted, however unlikely they are by chance.
  int min_num_inliers = 15;
  // Acceptance needs a number of false alarms below 10^-this: how often unrelated images give as
  // good a model (a-contrario test; Moisan and Stival, 2004).
  double min_log10_evidence = 6.0;
  // Pairs whose inliers leave the rotation more uncertain than this (degrees, one standard
  // deviation along the worst axis, for errors of a third of the threshold) are degenerate; where
  // only the translation is, the pair is panoramic.
  double max_pose_sigma_deg = 15.0;
  // Share of the inliers that must follow one homography, rotation or shift for a planar, panoramic
  // or watermark pair.
  double min_special_share = 0.8;
  // Label pairs whose inliers are marks in the frame of the images, and give them no pose.
  bool detect_watermark = true;
  // Limits of the sampling verifier.
  int max_iterations = 10000;
  int min_iterations = 100;
  // The solver of the 1AC+D verifier.
  std::string depth_solver = "proposed";
  // Hypotheses of the 1AC+D verifier are ranked by a soft support at this multiple of the
  // threshold, and so many of them are refined.
  double rough_error_ratio = 6.0;
  int max_num_refined = 60;

  void VisitFields(OptionVisitor& v) {
    v.Double(
        "max_error_px", max_error_px, {0.0, 1000.0},
        "inlier threshold on the Sampson error, px; 0: 0.05 % of the image diagonal, at least 1");
    v.Double("confidence", confidence, {0.0, 0.999999999},
             "chance that the best model was found before sampling stops");
    v.Int("min_num_matches", min_num_matches, {5, 1e9}, "pairs with fewer matches are not tried");
    v.Int("min_num_inliers", min_num_inliers, {5, 1e9},
          "pairs with fewer inliers are never accepted");
    v.Double("min_log10_evidence", min_log10_evidence, {-300.0, 300.0},
             "acceptance needs support that chance gives less than once in 10^this pairs");
    v.Double("max_pose_sigma_deg", max_pose_sigma_deg, {0.0, 180.0},
             "pairs whose rotation is more uncertain are degenerate, translation: panoramic");
    v.Double("min_special_share", min_special_share, {0.0, 1.0},
             "share of inliers on one homography, rotation or shift of a special pair");
    v.Bool("detect_watermark", detect_watermark, "give pairs of frame marks no pose");
    v.Int("max_iterations", max_iterations, {1, 1e9}, "most samples drawn for a pair");
    v.Int("min_iterations", min_iterations, {1, 1e9}, "fewest samples drawn for a pair");
    v.Choice("depth_solver", depth_solver, {"proposed", "umeyama"},
             "solver for one affine correspondence with depth");
    v.Double("rough_error_ratio", rough_error_ratio, {1.0, 1000.0},
             "scale of the support that ranks rough hypotheses, in units of max_error_px");
    v.Int("max_num_refined", max_num_refined, {1, 1e9}, "most hypotheses refined for a pair");
  }
};

}  // namespace cairn
