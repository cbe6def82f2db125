#include "database/match_origins.h"

#include "database/stage_names.h"

namespace cairn {

MatchOrigins::MatchOrigins(const Database& database) {
  for (const JobRecord& job : database.ReadJobs(kStageMatching)) {
    is_given_[static_cast<image_t>(job.item)] = job.note == kGivenNote;
  }
  for (const auto& [pair, num] : database.ReadNumMatches()) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    if (is_given_.contains(id1) && is_given_.contains(id2)) continue;
    unrecorded_.insert({id1, id2});
  }
}

bool MatchOrigins::IsGiven(image_t image) const {
  const auto recorded = is_given_.find(image);
  return recorded != is_given_.end() ? recorded->second : unrecorded_.contains(image);
}

bool MatchOrigins::AreGiven(image_pair_t pair) const {
  const auto [id1, id2] = PairIdToImagePair(pair);
  return IsGiven(id1) && IsGiven(id2);
}

bool MatchOrigins::AreOurs(image_pair_t pair) const {
  const auto [id1, id2] = PairIdToImagePair(pair);
  return is_given_.contains(id1) && is_given_.contains(id2) && !AreGiven(pair);
}

}  // namespace cairn
