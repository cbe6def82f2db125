#pragma once

#include "cairn/base/options.h"

namespace cairn {

struct ViewGraphBuilderOptions {
  int min_num_inliers = 15;
  double max_triplet_error_deg = 5.0;
  bool filter_ambiguous = true;
  int min_contradicting_loops = 5;
  double min_loop_agreement = 0.2;
  double max_rotation_error_deg = 10.0;

  void VisitFields(OptionVisitor& v) {
    v.Int("min_num_inliers", min_num_inliers, {0, 1e9}, "pairs with fewer inliers are left out");
    v.Double(
        "max_triplet_error_deg", max_triplet_error_deg, {0, 180},
        "pairs go whose rotation closes in no loop of three with trusted pairs, to within this "
        "angle, degrees; 180: none");
    v.Bool("filter_ambiguous", filter_ambiguous,
           "drop pairs that contradict many well-supported loops (repeated structure)");
    v.Int("min_contradicting_loops", min_contradicting_loops, {1, 1e9},
          "loops of trusted pairs that must contradict an ambiguous pair");
    v.Double("min_loop_agreement", min_loop_agreement, {0, 1},
             "a pair of which a smaller share of such loops agrees is ambiguous");
    v.Double("max_rotation_error_deg", max_rotation_error_deg, {0, 180},
             "in a reconstruction: largest angle between a pair and the global rotations, degrees");
  }
};

}  // namespace cairn
