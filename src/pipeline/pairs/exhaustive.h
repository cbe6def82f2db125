#pragma once

#include <map>
#include <set>
#include <vector>

#include "cairn/database/database.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {

// Images whose matches with each other come from another program, which decided which of their
// pairs are to be matched.
class GivenImages {
 public:
  // `ledger` is that of the matching stage.
  GivenImages(const Database& database, const StageLedger& ledger);

  bool Contains(image_t id) const;
  bool DecidedAbout(image_pair_t pair) const;
  // Those that the matching stage has no record of.
  const std::set<image_t>& unrecorded() const { return unrecorded_; }

 private:
  const StageLedger& ledger_;
  std::set<image_t> unrecorded_;
};

// All pairs of images with descriptors, without those that another program decided about.
std::vector<image_pair_t> ExhaustivePairs(const std::map<image_t, int>& num_descriptors,
                                          const GivenImages& given);

// Seconds that one core takes to match and verify all of these.
double ExhaustiveSeconds(const std::map<image_t, int>& num_descriptors, const GivenImages& given);

}  // namespace cairn
