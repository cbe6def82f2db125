#pragma once

#include "cairn/two_view/pair_verifier.h"
#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// A verifier that takes the focal lengths as they are.
class CalibratedVerifier : public PairVerifier {
 public:
  // What the last Verify prepared of a pair with enough matches, for those who go on with it; none
  // if not ordered by consensus.
  virtual const PreparedPair* pair_by_consensus() const { return nullptr; }
};

}  // namespace cairn::internal
