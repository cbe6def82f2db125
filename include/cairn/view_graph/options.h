#pragma once

#include <string>

#include "cairn/base/options.h"

namespace cairn {

struct ViewGraphBuilderOptions {
  int min_num_inliers = 15;
  bool filter_triplets = true;
  double max_triplet_error_deg = 5.0;
  bool filter_ambiguous = true;
  double max_rotation_error_deg = 10.0;
  bool filter_weak_bridges = true;
  int min_bridge_inliers = 50;
  // Of the whole program (--num_threads), no field: 0 means all. No result depends on it.
  int num_threads = 1;

  void VisitFields(OptionVisitor& v) {
    v.Int("min_num_inliers", min_num_inliers, {0, 1e9}, "pairs with fewer inliers are left out");
    v.Bool("filter_triplets", filter_triplets,
           "drop edges whose rotations close in no loop of three but could");
    v.Double(
        "max_triplet_error_deg", max_triplet_error_deg, {0, 180},
        "largest closing error of a loop of three rotations that counts as consistent, degrees");
    v.Bool("filter_ambiguous", filter_ambiguous,
           "drop edges that contradict many well-supported loops (repeated structure)");
    v.Double("max_rotation_error_deg", max_rotation_error_deg, {0, 180},
             "largest angle between an edge and the global rotations, degrees");
    v.Bool("filter_weak_bridges", filter_weak_bridges,
           "drop a bridge between two parts of the graph that rests on few inliers");
    v.Int("min_bridge_inliers", min_bridge_inliers, {0, 1e9}, "inliers that a bridge needs");
    v.Int("num_threads", num_threads, {0, 1024},
          "threads; 0: all. The result does not depend on it");
  }
};

}  // namespace cairn
