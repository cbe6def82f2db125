#include "database/own_matches.h"

#include "database/stage_names.h"

namespace cairn {

OwnMatches::OwnMatches(const Database& database) {
  for (const JobRecord& job : database.ReadJobs(kStageMatching)) {
    const auto image = static_cast<image_t>(job.item);
    images_.insert(image);
    if (job.note == kGivenNote) given_.insert(image);
  }
}

bool OwnMatches::Contains(image_pair_t pair) const {
  const auto [id1, id2] = PairIdToImagePair(pair);
  if (images_.count(id1) == 0 || images_.count(id2) == 0) return false;
  return given_.count(id1) == 0 || given_.count(id2) == 0;
}

}  // namespace cairn
