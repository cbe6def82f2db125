#include "pipeline/pairs/write.h"

#include "database/stage_names.h"

namespace cairn {

std::string PairOutcome::RejectionReason() const {
  if (runs.empty()) return std::string(PairStatusName(PairStatus::kTooFewMatches));
  const Run* nearest = &runs.back();
  for (const Run& run : runs) {
    if (run.report.num_inliers > nearest->report.num_inliers) nearest = &run;
  }
  return std::string(PairStatusName(nearest->report.status));
}

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
