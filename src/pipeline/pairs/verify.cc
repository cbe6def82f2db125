#include "pipeline/pairs/verify.h"

#include "cairn/base/timer.h"

namespace cairn {

PairOutcome TaskVerifier::Run(const PairTask& task) {
  PairOutcome outcome;
  outcome.pair_id = task.pair_id;
  outcome.input_hash = task.input_hash;
  outcome.num_matches = static_cast<int>(task.matches.size());
  if (!task.image1) {  // Too few matches.
    if (task.weigh_focals) outcome.focal_evidence = FocalEvidence();
    return outcome;
  }
  PairInput pair;
  pair.pair_id = task.pair_id;
  pair.seed = seed_;
  pair.camera1 = &task.image1->camera;
  pair.camera2 = &task.image2->camera;
  pair.keypoints1 = *task.image1->keypoints;
  pair.keypoints2 = *task.image2->keypoints;
  pair.depth1 = task.image1->depth;
  pair.depth2 = task.image2->depth;
  pair.matches = task.matches;
  pair.are_best_first = task.are_best_first;
  pair.weigh_focals = task.weigh_focals;
  if (verifiers_.empty()) {
    for (const NamedVerifier& maker : makers_) verifiers_.push_back(maker.make());
  }
  for (size_t i = 0; i < verifiers_.size(); ++i) {
    const Timer timer;
    PairReport report = verifiers_[i]->Verify(pair);
    if (!outcome.focal_evidence) outcome.focal_evidence = report.focal_evidence;
    const std::string step(report.verifier);
    outcome.runs.push_back({makers_[i].name, step, std::move(report), timer.Seconds()});
  }
  const bool was_weighed = task.weigh_focals && pair.camera1->has_prior_focal_length &&
                           pair.camera2->has_prior_focal_length;
  if (was_weighed && !outcome.focal_evidence) outcome.focal_evidence = FocalEvidence();
  outcome.winner = ChooseWinner(outcome.runs);
  return outcome;
}

}  // namespace cairn
