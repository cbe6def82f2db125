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
  int min_num_inliers = 12;
  // Number of pairs of unrelated images, as log10, among which one is accepted by mistake:
  // acceptance needs log10(NFA) below minus this (a-contrario test; Moisan and Stival, 2004).
  double min_log10_evidence = 6.0;
  // Limits of the sampling verifier.
  int max_iterations = 10000;
  int min_iterations = 100;
  // The solver of the 1AC+D verifier.
  std::string depth_solver = "proposed";

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
             "acceptance needs support that chance gives once in 10^this pairs");
    v.Int("max_iterations", max_iterations, {1, 1e9}, "most samples drawn for a pair");
    v.Int("min_iterations", min_iterations, {1, 1e9}, "fewest samples drawn for a pair");
    v.Choice("depth_solver", depth_solver, {"proposed", "umeyama"},
             "solver for one affine correspondence with depth");
  }
};

}  // namespace cairn
