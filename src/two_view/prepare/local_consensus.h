#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cairn/two_view/pair_verifier.h"

namespace cairn::internal {

// How often the affine frames of neighbouring matches predict each other. The frames of match i map
// the surroundings of its first point to those of its second one by A = M2 M1^-1; a match j near by
// in both images that lies where A says it should is a vote for i and for j. Matches of unrelated
// images almost never vote for each other, right matches of smooth surfaces almost always do, so
// votes tell right matches from wrong ones before any pose is known. (The idea of local affine
// consensus: Cavalli et al., "Handcrafted outlier detection revisited" (AdaLAM), ECCV 2020; Bian et
// al., GMS, CVPR 2017. No code of theirs.)
//
// They only order the matches and set budgets: what is accepted is decided by geometry alone.
struct LocalConsensus {
  std::vector<int> votes;  // of input.matches[indices[k]]
  // All votes, and as many as frames that have nothing to do with each other would give between
  // matches that are neighbours in both images.
  double num_votes = 0.0, num_votes_by_chance = 0.0;
};

// Time O(n times the number of neighbours); neighbourhoods shrink where matches are many.
LocalConsensus CountVotes(const PairInput& input, std::span<const int32_t> indices);

}  // namespace cairn::internal
