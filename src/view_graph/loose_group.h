#pragma once

#include <set>
#include <span>

#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// Images that match those around them far worse than these match each other.
struct LooseGroup {
  std::set<image_t> images, others;  // others: those around them
  // The share of the points that images of both sides should see which both do, by that within the
  // looser one of the sides.
  double relative_rate = 1;

  // It may be another place that looks alike, or the same one at night, say.
  bool IsLoose() const { return relative_rate < 0.25; }
};

// Images are joined to groups along the highest of such shares, those of all pairs between two
// groups taken together. Of the groups on that way, the one that was joined with the lowest
// relative rate; none: two groups of three images and more have no pairs enough that tell.
// `tried`: the pairs whose images were matched, with or without success.
LooseGroup FindLooseGroup(const Reconstruction& model, std::span<const image_pair_t> tried,
                          const RunContext& run = {});

}  // namespace cairn
