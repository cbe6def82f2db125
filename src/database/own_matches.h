#pragma once

#include <set>

#include "cairn/database/database.h"

namespace cairn {

// The note of a matching record: its image came with matches of another program.
inline constexpr char kGivenNote[] = "given";

// Which pairs our own matching stage matched: their matches are best first (MatchDescriptors);
// those of other programs are in no known order.
class OwnMatches {
 public:
  explicit OwnMatches(const Database& database);
  // A pair of ours has records for both images, of which at most one came with matches.
  bool Contains(image_pair_t pair) const;

 private:
  std::set<image_t> images_, given_;
};

}  // namespace cairn
