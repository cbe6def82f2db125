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
class LocalConsensus {
 public:
  // Counts the votes of input.matches[indices[k]] into votes()[k], each at most kMaxVotes.
  // Time O(n times the number of neighbours); neighbourhoods shrink where matches are many.
  void Count(const PairInput& input, std::span<const int32_t> indices);

  static constexpr int kMaxVotes = 8;
  const std::vector<uint8_t>& votes() const { return votes_; }
  int num_supported() const { return num_supported_; }  // matches with a vote
  // All votes, and as many as frames that have nothing to do with each other would give between
  // matches that are neighbours in both images.
  double num_votes() const { return num_votes_; }
  double num_votes_by_chance() const { return num_votes_by_chance_; }

 private:
  void Sort();

  int size_ = 0;
  // Columns of size_ + padding floats: x1 y1 x2 y2, A (4), A^-1 (4); then the same sorted by x1.
  std::vector<float> columns_, sorted_;
  std::vector<float> counts_;
  std::vector<int32_t> order_;
  std::vector<uint64_t> keys_;
  std::vector<uint8_t> votes_;
  int num_supported_ = 0;
  double num_votes_ = 0, num_votes_by_chance_ = 0;
};

}  // namespace cairn::internal
