// Positions of photographs by GPS, as COLMAP keeps them: up to 3.9 latitude, longitude and altitude
// in columns of `images`, from 3.10 on in the table pose_priors.
#include <cmath>
#include <cstring>

#include "database/query.h"

namespace cairn {
namespace {

// Absent unless the numbers can be a place on Earth. COLMAP writes NaN for what it does not know,
// its script database.py zeros.
std::optional<GpsPosition> PositionOf(double latitude, double longitude, double altitude) {
  GpsPosition position{latitude, longitude};
  if (!position.IsOnEarth() || (latitude == 0 && longitude == 0)) return std::nullopt;
  if (std::isfinite(altitude)) position.altitude_m = altitude;
  return position;
}

}  // namespace

std::map<image_t, GpsPosition> Database::ReadGpsPriors() const {
  std::map<image_t, GpsPosition> positions;
  const auto add = [&](image_t id, const std::optional<GpsPosition>& position) {
    if (position) positions.insert_or_assign(id, *position);
  };
  if (ColumnExists(*impl_, "images", "prior_tx")) {
    Query query(*impl_,
                "SELECT image_id, prior_tx, prior_ty, prior_tz FROM usable_images "
                "JOIN images USING (image_id) WHERE prior_tx NOT NULL AND prior_ty NOT NULL AND "
                "prior_tz NOT NULL;");
    while (query.Step()) {
      add(query.Int<image_t>(0), PositionOf(query.Double(1), query.Double(2), query.Double(3)));
    }
  }
  if (!ColumnExists(*impl_, "pose_priors", "coordinate_system")) return positions;
  // 4.x: of any sensor; 0 is a camera. Coordinate system 0 is WGS84.
  const bool has_sensors = ColumnExists(*impl_, "pose_priors", "corr_data_id");
  Query query(*impl_, has_sensors ? "SELECT corr_data_id, position FROM pose_priors WHERE "
                                    "coordinate_system = 0 AND corr_sensor_type = 0;"
                                  : "SELECT image_id, position FROM pose_priors WHERE "
                                    "coordinate_system = 0;");
  while (query.Step()) {
    const std::span<const std::byte> blob = query.Blob(1);
    double values[3];
    if (blob.size() != sizeof(values) || !HasImage(query.Int<image_t>(0))) continue;
    std::memcpy(values, blob.data(), sizeof(values));
    add(query.Int<image_t>(0), PositionOf(values[0], values[1], values[2]));
  }
  return positions;
}

void Database::WriteGpsPrior(image_t image_id, const GpsPosition& position) {
  if (!position.altitude_m || !ColumnExists(*impl_, "images", "prior_tx")) return;
  Run(*impl_, "UPDATE images SET prior_tx = ?2, prior_ty = ?3, prior_tz = ?4 WHERE image_id = ?1;",
      image_id, position.latitude_deg, position.longitude_deg, *position.altitude_m);
}

}  // namespace cairn
