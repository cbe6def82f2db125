#include "cairn/database/database.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {

std::vector<PairFocalEvidence> Database::ReadFocalEvidence() const {
  std::vector<PairFocalEvidence> evidence;
  if (!impl_->has_focal_tables) return evidence;
  Query query(*impl_, sql::kReadFocalEvidence);
  while (query.Step()) {
    evidence.push_back({static_cast<image_pair_t>(query.Int(0)), static_cast<int>(query.Int(1)),
                        static_cast<int>(query.Int(2)), static_cast<int>(query.Int(3))});
  }
  return evidence;
}

void Database::WriteFocalEvidence(const PairFocalEvidence& evidence) {
  Query(*impl_, sql::kWriteFocalEvidence)
      .Bind(1, evidence.pair_id)
      .Bind(2, evidence.num_matches)
      .Bind(3, evidence.num_by_essential)
      .Bind(4, evidence.num_by_fundamental)
      .Run();
}

std::map<camera_t, CameraFocal> Database::ReadCameraFocals() const {
  std::map<camera_t, CameraFocal> focals;
  if (!impl_->has_focal_tables) return focals;
  Query query(*impl_, sql::kReadCameraFocals);
  while (query.Step()) {
    focals[static_cast<camera_t>(query.Int(0))] = {
        query.Int(1) != 0, static_cast<int>(query.Int(2)), static_cast<int>(query.Int(3))};
  }
  return focals;
}

void Database::WriteCameraFocal(camera_t camera_id, const CameraFocal& focal) {
  Query(*impl_, sql::kWriteCameraFocal)
      .Bind(1, camera_id)
      .Bind(2, static_cast<int>(focal.is_rejected))
      .Bind(3, focal.num_pairs)
      .Bind(4, focal.num_contradicting)
      .Run();
}

std::map<camera_t, CameraLens> Database::ReadCameraLenses() const {
  std::map<camera_t, CameraLens> lenses;
  if (!impl_->has_lens_table) return lenses;
  Query query(*impl_, sql::kReadCameraLenses);
  while (query.Step()) {
    lenses[static_cast<camera_t>(query.Int(0))] = {
        query.Double(1), query.Double(2), query.Int(3) != 0,
        query.Double(4), query.Double(5), static_cast<int>(query.Int(6))};
  }
  return lenses;
}

void Database::WriteCameraLens(camera_t camera_id, const CameraLens& lens) {
  Query(*impl_, sql::kWriteCameraLens)
      .Bind(1, camera_id)
      .Bind(2, lens.focal_px)
      .Bind(3, lens.focal_sigma)
      .Bind(4, static_cast<int>(lens.is_focal_known))
      .Bind(5, lens.k)
      .Bind(6, lens.k_sigma)
      .Bind(7, lens.num_pairs)
      .Run();
}

void Database::DeletePairResults(image_pair_t pair_id) {
  for (const char* sql :
       {sql::kDeleteTwoViewGeometry, sql::kDeletePairMetrics, sql::kDeleteFocalEvidence}) {
    Query(*impl_, sql).Bind(1, pair_id).Run();
  }
}

}  // namespace cairn
