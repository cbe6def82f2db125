#pragma once

#include <string>
#include <vector>

#include "cairn/base/options.h"

namespace cairn {

// Depth is smoothed over `value` and its gradient taken over `gradient`: standard deviations of a
// Gaussian, fractions of the larger image side.
struct DepthWindows {
  double value = 0.0;
  double gradient = 0.0;
};

// The defaults of the network's input are those of FastDepth: RGB in [0, 1], 224 x 224.
struct DepthOptions {
  std::string kind = "depth";
  double scale = 1.0;
  std::vector<double> value_window = {0.026, 0.003, 0.08};
  std::vector<double> gradient_window = {0.1, 0.01, 0.3};
  int input_size = 224;
  std::vector<double> mean = {0.0, 0.0, 0.0};
  std::vector<double> std = {1.0, 1.0, 1.0};

  // The scales at which depth is sampled; the first one holds where nothing is known of an image,
  // verification chooses among them. Throws ConfigError where the windows do not go together.
  std::vector<DepthWindows> Scales() const;

  void VisitFields(OptionVisitor& v) {
    v.Choice("kind", kind, {"depth", "inverse", "log"},
             "what a map or network gives: z-depth, its inverse (of unknown scale and shift), or "
             "its natural logarithm");
    v.Double("scale", scale, {1e-12, 1e12}, "raw values are multiplied by this (16-bit .png)");
    v.Doubles("value_window", value_window,
              "depth is smoothed over this fraction of the larger image side");
    v.Doubles(
        "gradient_window", gradient_window,
        "the depth gradient is taken over this fraction of the larger image side: some pixels "
        "for measured depth, a tenth and more for networks. Several values, one for each "
        "value_window: an image begins with the first, verified pairs then tell the best");
    v.Int("input_size", input_size, {16, 4096}, "width and height of the network's input");
    v.Doubles("mean", mean, "subtracted from the network's input, RGB in [0, 1]");
    v.Doubles("std", std, "then divides the network's input");
  }
};

}  // namespace cairn
