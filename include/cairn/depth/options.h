#pragma once

#include <vector>

#include "cairn/base/options.h"

namespace cairn {

// What a map or network gives: z-depth, its inverse (of unknown scale and shift), or its natural
// logarithm.
enum class DepthKind { kDepth, kInverse, kLog };
inline constexpr NamedValue<DepthKind> kDepthKinds[] = {
    {DepthKind::kDepth, "depth"}, {DepthKind::kInverse, "inverse"}, {DepthKind::kLog, "log"}};

// Windows are standard deviations of a Gaussian. The defaults of the network's input are those of
// FastDepth: RGB in [0, 1], 224 x 224.
struct DepthOptions {
  DepthKind kind = DepthKind::kDepth;
  double scale = 1.0;
  double value_window = 0.026;
  double gradient_window = 0.1;
  int input_size = 224;
  std::vector<double> mean = {0.0, 0.0, 0.0};
  std::vector<double> std = {1.0, 1.0, 1.0};

  void VisitFields(OptionVisitor& v) {
    v.Choice("kind", kind, kDepthKinds,
             "what a map or network gives: z-depth, its inverse (of unknown scale and shift), or "
             "its natural logarithm");
    v.Double("scale", scale, {1e-12, 1e12}, "raw values are multiplied by this (16-bit .png)");
    v.Double("value_window", value_window, {0, 1},
             "depth is smoothed over this fraction of the larger image side");
    v.Double("gradient_window", gradient_window, {0, 1},
             "the depth gradient is taken over this fraction of the larger image side: some pixels "
             "for measured depth, a tenth and more for networks");
    v.Int("input_size", input_size, {16, 4096}, "width and height of the network's input");
    v.Doubles("mean", mean, "subtracted from the network's input, RGB in [0, 1]");
    v.Doubles("std", std, "then divides the network's input");
  }
};

}  // namespace cairn
