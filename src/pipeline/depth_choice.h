#pragma once

#include <map>

#include "cairn/base/types.h"
#include "cairn/database/records.h"
#include "cairn/two_view/depth_evidence.h"

namespace cairn {

// What a verified pair says, and how many hypotheses of all its matches its samples stand for.
struct PairDepthEvidence {
  DepthEvidence evidence;
  int64_t num_hypotheses = 0;
};

// How the depth of each image is best read, from the evidence of pairs: the scale that gives the
// most right hypotheses, and a shift of the inverse depth, the weighted median over the pairs,
// where that is three standard deviations from zero and does not cost right hypotheses. An image
// leaves the first scale only for a gain that is no chance. First all images alike move (maps have
// one source), then each in turn, until none does. Images in `known` stay as they are and are not
// in the result, nor are images with fewer than two pairs or 50 samples.
std::map<image_t, ImageDepth> ChooseDepth(const std::map<image_pair_t, PairDepthEvidence>& evidence,
                                          const std::map<image_t, ImageDepth>& known);

// Share of an image's 1AC+D hypotheses that can be expected to be right: one more than seen, as the
// next may be one.
double DepthTrust(const ImageDepth& depth);

}  // namespace cairn
