#pragma once

#include <cstdint>
#include <string>

#include "cairn/base/options.h"

namespace cairn {

struct TranslationAveragingOptions {
  bool filter_directions = true;
  int filter_num_axes = 48;
  double filter_max_inconsistency = 0.1;
  std::string method = "scale_free";
  double huber_deg = 1.0;
  double point_weight = 1.0;
  bool use_points = true;
  int max_iterations = 100;
  double min_spread = 1e-3;
  // Of the whole program (--seed), no field.
  uint64_t seed = 0;
  // Of the whole program (--num_threads), no field: 0 means all. No result depends on it.
  int num_threads = 1;

  void VisitFields(OptionVisitor& v) {
    v.Bool("filter_directions", filter_directions, "drop inconsistent directions first (1DSfM)");
    v.Int("filter_num_axes", filter_num_axes, {1, 10000}, "random axes of the 1DSfM filter");
    v.Double("filter_max_inconsistency", filter_max_inconsistency, {0, 1},
             "an edge goes whose mean inconsistency over the axes is larger (1DSfM: 0.1)");
    v.Choice("method", method, {"scale_free", "chordal"}, "cost of the nonlinear fit");
    v.Double("huber_deg", huber_deg, {1e-6, 180},
             "angle from which errors count linearly, degrees");
    v.Double("point_weight", point_weight, {0, 1e6},
             "weight of all rays of a camera relative to its camera-camera directions");
    v.Bool("use_points", use_points, "fit camera-point directions too");
    v.Int("max_iterations", max_iterations, {1, 10000}, "iterations of the nonlinear fit");
    v.Double("min_spread", min_spread, {0, 1},
             "refuse the result when half of the cameras lie within this fraction of the extent");
    v.Int("num_threads", num_threads, {0, 1024},
          "threads; 0: all. The result does not depend on it");
  }
};

}  // namespace cairn
