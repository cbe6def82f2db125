#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cairn/pipeline/verify_pairs.h"
#include "pipeline/pairs/feed.h"
#include "pipeline/pairs/write.h"

namespace cairn {

// One thread's verifiers, which it makes when it needs them.
class TaskVerifier {
 public:
  TaskVerifier(const std::vector<NamedVerifier>& makers, uint64_t seed)
      : makers_(makers), seed_(seed) {}

  PairOutcome Run(const PairTask& task);

 private:
  const std::vector<NamedVerifier>& makers_;
  const uint64_t seed_;
  std::vector<std::unique_ptr<PairVerifier>> verifiers_;
};

}  // namespace cairn
