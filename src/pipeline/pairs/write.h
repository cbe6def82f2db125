#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/database/database.h"
#include "cairn/two_view/pair_verifier.h"

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

// The verified run with the largest score; of equal ones the first. -1 if there is none.
int ChooseWinner(const std::vector<PairOutcome::Run>& runs);

// Writes the evidence about the focal lengths of a pair, if it was asked for it.
void WriteFocalEvidence(Database& database, const PairOutcome& outcome);

// Writes the pair's rows; the note of its job is the reason of a rejection.
void WriteOutcome(Database& database, const PairOutcome& outcome);

}  // namespace cairn
