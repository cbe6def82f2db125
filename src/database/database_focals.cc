#include "cairn/database/database.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {

std::vector<PairFocalEvidence> Database::ReadFocalEvidence() const {
  std::vector<PairFocalEvidence> evidence;
  Query query(*impl_, sql::kReadFocalEvidence);
  while (query.Step()) {
    evidence.push_back({static_cast<image_pair_t>(query.Int(0)), static_cast<int>(query.Int(1)),
                        static_cast<int>(query.Int(2)), static_cast<int>(query.Int(3))});
  }
  return evidence;
}

void Database::WriteFocalEvidence(const PairFocalEvidence& evidence) {
  Run(*impl_, sql::kWriteFocalEvidence, evidence.pair_id, evidence.num_matches,
      evidence.num_by_essential, evidence.num_by_fundamental);
}

void Database::DeleteFocalEvidence(image_pair_t pair_id) {
  Run(*impl_, sql::kDeleteFocalEvidence, pair_id);
}

std::map<camera_t, CameraFocal> Database::ReadCameraFocals() const {
  std::map<camera_t, CameraFocal> focals;
  Query query(*impl_, sql::kReadCameraFocals);
  while (query.Step()) {
    focals[static_cast<camera_t>(query.Int(0))] = {
        query.Int(1) != 0, static_cast<int>(query.Int(2)), static_cast<int>(query.Int(3))};
  }
  return focals;
}

void Database::WriteCameraFocals(const std::map<camera_t, CameraFocal>& focals) {
  Run(*impl_, sql::kClearCameraFocals);
  for (const auto& [id, focal] : focals) {
    Run(*impl_, sql::kWriteCameraFocal, id, focal.is_rejected, focal.num_pairs,
        focal.num_contradicting);
  }
}

std::map<camera_t, CameraLens> Database::ReadCameraLenses() const {
  std::map<camera_t, CameraLens> lenses;
  Query query(*impl_, sql::kReadCameraLenses);
  while (query.Step()) {
    lenses[static_cast<camera_t>(query.Int(0))] = {
        query.Double(1), query.Double(2), query.Int(3) != 0,
        query.Double(4), query.Double(5), static_cast<int>(query.Int(6))};
  }
  return lenses;
}

void Database::WriteCameraLens(camera_t camera_id, const CameraLens& lens) {
  Run(*impl_, sql::kWriteCameraLens, camera_id, lens.focal_px, lens.focal_sigma,
      lens.is_focal_known, lens.k, lens.k_sigma, lens.num_pairs);
}

void Database::DeletePairResults(image_pair_t pair_id) {
  for (const char* sql : {sql::kDeleteTwoViewGeometry, sql::kDeletePairMetrics}) {
    Run(*impl_, sql, pair_id);
  }
}

}  // namespace cairn
