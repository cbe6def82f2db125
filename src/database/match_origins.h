#pragma once

#include <set>
#include <unordered_map>

#include "cairn/database/database.h"

namespace cairn {

// The note of a matching record: its image came with matches of another program.
inline constexpr char kGivenNote[] = "given";

// Who matched the pairs of a database: our matching stage, best first (MatchDescriptors), or
// another program, in no known order.
class MatchOrigins {
 public:
  explicit MatchOrigins(const Database& database);
  // Did the image come with matches of another program?
  bool IsGiven(image_t image) const;
  // Of two such images that program decided whether they are matched.
  bool AreGiven(image_pair_t pair) const;
  // A pair of ours has records for both images, of which at most one came with matches.
  bool AreOurs(image_pair_t pair) const;
  // Images with matches that our stage has no record of.
  const std::set<image_t>& unrecorded() const { return unrecorded_; }

 private:
  std::unordered_map<image_t, bool> is_given_;  // of images that our stage has a record of
  std::set<image_t> unrecorded_;
};

}  // namespace cairn
