#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/pipeline/verify_pairs.h"
#include "pipeline/pairs/feed.h"

namespace cairn {

// What the verifiers found for one pair, ready to be written.
struct PairOutcome {
  image_pair_t pair_id = 0;
  uint64_t input_hash = 0;
  int num_matches = 0;
  struct Run {
    std::string verifier;
    std::string step;  // of the verifier, that found the report's model
    PairReport report;
    double seconds = 0;
  };
  std::vector<Run> runs;                        // empty: not tried
  int winner = -1;                              // index into runs, -1: no verifier accepted
  std::optional<FocalEvidence> focal_evidence;  // of the first run that has it, or none of it

  // Why it was rejected: the reason of the run that came nearest.
  std::string RejectionReason() const;
};

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

// Writes the evidence about the focal lengths of a pair, if it was asked for it.
void WriteFocalEvidence(Database& database, const PairOutcome& outcome);

// Writes the pair's rows; the note of its job is the reason of a rejection.
void WriteOutcome(Database& database, const PairOutcome& outcome);

}  // namespace cairn
