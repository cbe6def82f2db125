#include "pipeline/pairs/verify.h"

#include "cairn/base/timer.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

// The verified run with the largest score; of equal ones the first. -1 if there is none.
int ChooseWinner(const std::vector<PairOutcome::Run>& runs) {
  int winner = -1;
  for (size_t i = 0; i < runs.size(); ++i) {
    if (runs[i].report.status != PairStatus::kVerified) continue;
    if (winner < 0 || runs[i].report.score > runs[winner].report.score) {
      winner = static_cast<int>(i);
    }
  }
  return winner;
}

}  // namespace

std::string PairOutcome::RejectionReason() const {
  if (runs.empty()) return std::string(PairStatusName(PairStatus::kTooFewMatches));
  const Run* nearest = &runs.back();
  for (const Run& run : runs) {
    if (run.report.num_inliers > nearest->report.num_inliers) nearest = &run;
  }
  return std::string(PairStatusName(nearest->report.status));
}

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
  pair.keypoints1 = task.image1->keypoints;
  pair.keypoints2 = task.image2->keypoints;
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

void WriteFocalEvidence(Database& database, const PairOutcome& outcome) {
  if (!outcome.focal_evidence) return;
  database.WriteFocalEvidence({outcome.pair_id, outcome.focal_evidence->num_matches,
                               outcome.focal_evidence->num_by_essential,
                               outcome.focal_evidence->num_by_fundamental});
}

void WriteOutcome(Database& database, const PairOutcome& outcome) {
  for (size_t i = 0; i < outcome.runs.size(); ++i) {
    const PairOutcome::Run& run = outcome.runs[i];
    const PairReport& report = run.report;
    PairMetrics metrics;
    metrics.pair_id = outcome.pair_id;
    metrics.verifier = run.verifier;
    metrics.status = PairStatusName(report.status);
    metrics.is_winner = static_cast<int>(i) == outcome.winner;
    metrics.step = run.step;
    metrics.num_matches = outcome.num_matches;
    metrics.num_inliers = report.num_inliers;
    metrics.num_iterations = report.num_iterations;
    metrics.score = report.score;
    metrics.residual_px = report.residual_px;
    metrics.triangulation_angle_deg = report.triangulation_angle_deg;
    if (report.status == PairStatus::kVerified) {
      metrics.cam2_from_cam1 = report.geometry.cam2_from_cam1;
    }
    database.WritePairMetrics(metrics);
    database.WriteTiming(kStageVerification, outcome.pair_id, run.verifier, run.seconds);
  }
  WriteFocalEvidence(database, outcome);
  const bool is_verified = outcome.winner >= 0;
  database.WriteTwoViewGeometry(outcome.pair_id, is_verified
                                                     ? outcome.runs[outcome.winner].report.geometry
                                                     : TwoViewGeometry());
  database.WriteJob(kStageVerification, {outcome.pair_id, outcome.input_hash,
                                         is_verified ? "" : outcome.RejectionReason()});
}

}  // namespace cairn
