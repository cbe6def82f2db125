#pragma once

#include "cairn/base/options.h"

namespace cairn {

struct TranslationAveragingOptions {
  int filter_num_axes = 48;
  double filter_max_inconsistency = 0.1;
  double huber_deg = 1.0;
  double point_weight = 10.0;
  int num_reweightings = 1;
  int max_iterations = 100;
  double max_median_error_deg = 45.0;

  void VisitFields(OptionVisitor& v) {
    v.Int("filter_num_axes", filter_num_axes, {1, 10000}, "random axes of the 1DSfM filter");
    v.Double(
        "filter_max_inconsistency", filter_max_inconsistency, {0, 1},
        "a direction goes whose mean inconsistency over the axes is larger (1DSfM: 0.1); 1: none");
    v.Double("huber_deg", huber_deg, {1e-6, 179},
             "angle from which errors count linearly in the first fit, degrees");
    v.Double(
        "point_weight", point_weight, {0, 1e6},
        "weight of all rays to points relative to all camera-camera directions in the first fit");
    v.Int("num_reweightings", num_reweightings, {0, 100},
          "further fits with weights from the errors of the one before: inverse variances of "
          "directions and rays, gross errors out");
    v.Int("max_iterations", max_iterations, {1, 10000}, "iterations of each fit");
    v.Double("max_median_error_deg", max_median_error_deg, {0, 180},
             "refuse the result when the median angle to the directions is larger, degrees");
  }
};

}  // namespace cairn
