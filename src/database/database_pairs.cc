#include <cmath>
#include <cstring>

#include "cairn/base/error.h"
#include "cairn/database/database.h"
#include "database/bad_rows.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {
namespace {

using RowMajorMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

std::string RowName(const char* table, image_pair_t pair_id) {
  return PairRowName(table, static_cast<int64_t>(pair_id));
}

// Of a table of pairs: what a query is at, and its name in errors.
struct PairRow {
  const Database::Impl& impl;
  const Query& query;
  std::string name;
};

FeatureMatches MatchesOf(const PairRow& row) {
  const MatrixBlob matrix = ReadMatrixBlob(row.impl, row.query, sizeof(uint32_t), row.name);
  FeatureMatches matches(static_cast<size_t>(matrix.rows));
  if (matches.empty()) return matches;
  if (matrix.cols != 2) {
    throw IoError(row.impl.path,
                  row.name + ": " + std::to_string(matrix.cols) + " columns instead of 2");
  }
  static_assert(sizeof(FeatureMatch) == 2 * sizeof(uint32_t));
  std::memcpy(static_cast<void*>(matches.data()), matrix.data,
              matches.size() * sizeof(FeatureMatch));
  return matches;
}

// Fills `values` from the column's blob; false where it is NULL or empty.
template <size_t n>
bool ReadDoubles(const PairRow& row, int column, const char* column_name, double (&values)[n]) {
  const std::span<const std::byte> blob = row.query.Blob(column);
  if (blob.empty()) return false;
  if (blob.size() != sizeof(values)) {
    throw IoError(row.impl.path, row.name + ": " + column_name + " needs " +
                                     std::to_string(sizeof(values)) + " bytes, but the blob has " +
                                     std::to_string(blob.size()));
  }
  std::memcpy(values, blob.data(), sizeof(values));
  for (const double value : values) {
    if (std::isfinite(value)) continue;
    throw IoError(row.impl.path, row.name + ": " + column_name + " has a value that is not finite");
  }
  return true;
}

std::optional<Eigen::Matrix3d> ReadMatrix3d(const PairRow& row, int column,
                                            const char* column_name) {
  double values[9];
  if (!ReadDoubles(row, column, column_name, values)) return std::nullopt;
  const Eigen::Matrix3d matrix = Eigen::Map<const RowMajorMatrix3d>(values);
  // COLMAP 3.8 writes zeros for what it did not estimate.
  if (matrix.isZero(0)) return std::nullopt;
  return matrix;
}

// Can it be normalized, without overflow or loss of digits?
template <class Vector>
bool HasNorm(const Vector& vector) {
  const double squared_norm = vector.squaredNorm();
  return squared_norm > 1e-200 && squared_norm < 1e200;
}

std::optional<Rigid3d> ReadPose(const PairRow& row, int qvec_column) {
  double q[4];
  double t[3];
  if (!ReadDoubles(row, qvec_column, "qvec", q)) return std::nullopt;
  if (!ReadDoubles(row, qvec_column + 1, "tvec", t)) return std::nullopt;
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  const Eigen::Vector3d translation(t[0], t[1], t[2]);
  if (rotation.coeffs().isZero(0)) return std::nullopt;
  if (!HasNorm(rotation.coeffs()) || (!translation.isZero(0) && !HasNorm(translation))) {
    throw IoError(row.impl.path,
                  row.name + ": its pose has a number that is too large or too small");
  }
  // Up to 3.13 COLMAP wrote the identity for a pose that it did not estimate.
  if (rotation.vec().isZero(0) && translation.isZero(0)) return std::nullopt;
  // Only what is not a unit quaternion is normalized, so that what we wrote is read to the bit.
  const bool is_unit = std::abs(rotation.squaredNorm() - 1.0) < 1e-12;
  return Rigid3d(is_unit ? rotation : rotation.normalized(), translation);
}

// As they are stored.
std::optional<std::array<double, 9>> RowMajor(const std::optional<Eigen::Matrix3d>& matrix) {
  std::optional<std::array<double, 9>> values;
  if (matrix) Eigen::Map<RowMajorMatrix3d>(values.emplace().data()) = *matrix;
  return values;
}

std::optional<std::array<double, 4>> QvecOf(const std::optional<Rigid3d>& pose) {
  if (!pose) return std::nullopt;
  const Eigen::Quaterniond& q = pose->rotation;
  return {{q.w(), q.x(), q.y(), q.z()}};
}

std::optional<std::array<double, 3>> TvecOf(const std::optional<Rigid3d>& pose) {
  if (!pose) return std::nullopt;
  const Eigen::Vector3d& t = pose->translation;
  return {{t.x(), t.y(), t.z()}};
}

// COLMAP 4.x knows 9, calibrated rig.
TwoViewConfig ConfigFromInt(int64_t config) {
  if (config >= 0 && config <= 8) return static_cast<TwoViewConfig>(config);
  return config == 9 ? TwoViewConfig::kCalibrated : TwoViewConfig::kUndefined;
}

std::vector<std::pair<image_pair_t, int>> ReadNumRowsOfPairs(Query&& query) {
  return ReadRows<std::vector<std::pair<image_pair_t, int>>>(
      std::move(query),
      [](const Query& row) { return std::pair(row.Int<image_pair_t>(0), row.Int<int>(1)); });
}

std::vector<image_pair_t> IdsWithRows(const std::vector<std::pair<image_pair_t, int>>& num_rows) {
  std::vector<image_pair_t> ids;
  for (const auto& [pair_id, rows] : num_rows) {
    if (rows > 0) ids.push_back(pair_id);
  }
  return ids;
}

PairMetrics MetricsFromRow(const Database::Impl& impl, const Query& row) {
  PairMetrics m;
  m.pair_id = row.Int<image_pair_t>(0);
  m.verifier = row.Text(1);
  m.status = row.Text(2);
  m.is_winner = row.Int<bool>(3);
  m.step = row.Text(4);
  m.num_matches = row.Int<int>(5);
  m.num_inliers = row.Int<int>(6);
  m.num_iterations = row.Int(7);
  m.score = row.Double(8);
  m.residual_px = row.Double(9);
  m.triangulation_angle_deg = row.Double(10);
  try {
    m.cam2_from_cam1 = ReadPose({impl, row, RowName("cairn_pair_metrics", m.pair_id)}, 11);
  } catch (const IoError&) {  // a figure for people, which the row can do without
  }
  return m;
}

}  // namespace

std::vector<std::pair<image_pair_t, int>> Database::ReadNumMatches() const {
  return ReadNumRowsOfPairs({*impl_,
                             "SELECT pair_id, rows FROM matches WHERE " CAIRN_SQL_USABLE_PAIR
                             " ORDER BY pair_id;"});
}

std::vector<std::pair<image_pair_t, int>> Database::ReadNumInliers() const {
  return ReadNumRowsOfPairs(
      {*impl_, "SELECT pair_id, rows FROM two_view_geometries WHERE " CAIRN_SQL_USABLE_PAIR
               " ORDER BY pair_id;"});
}

std::vector<image_pair_t> Database::ReadMatchedPairIds() const {
  return IdsWithRows(ReadNumMatches());
}

std::vector<image_pair_t> Database::ReadTwoViewGeometryPairIds() const {
  return IdsWithRows(ReadNumInliers());
}

bool Database::HasGeometry(image_pair_t pair_id) const {
  Query query(*impl_, "SELECT F, E, H, qvec, tvec FROM two_view_geometries WHERE pair_id = ?1;",
              pair_id);
  if (!query.Step()) return false;
  const PairRow row{*impl_, query, RowName("two_view_geometries", pair_id)};
  return ReadMatrix3d(row, 0, "F") || ReadMatrix3d(row, 1, "E") || ReadMatrix3d(row, 2, "H") ||
         ReadPose(row, 3);
}

std::vector<image_pair_t> Database::ReadPairsToVerify() const {
  return ReadRows<std::vector<image_pair_t>>(
      {*impl_,
       "SELECT pair_id FROM (SELECT pair_id FROM matches"
       " WHERE EXISTS (SELECT 1 FROM cairn_jobs) UNION SELECT pair_id FROM cairn_pair_choices)"
       " WHERE pair_id NOT IN (SELECT pair_id FROM two_view_geometries)"
       " AND " CAIRN_SQL_USABLE_PAIR " ORDER BY pair_id;"},
      [](const Query& row) { return row.Int<image_pair_t>(0); });
}

std::optional<FeatureMatches> Database::ReadMatches(image_pair_t pair_id) const {
  Query query(*impl_, "SELECT rows, cols, data FROM matches WHERE pair_id = ?1;", pair_id);
  if (!query.Step()) return std::nullopt;
  return MatchesOf({*impl_, query, RowName("matches", pair_id)});
}

void Database::WriteMatches(image_pair_t pair_id, const FeatureMatches& matches) {
  Run(*impl_, "INSERT OR REPLACE INTO matches(pair_id, rows, cols, data) VALUES(?1, ?2, ?3, ?4);",
      pair_id, matches.size(), 2, BoundBlob{matches.data(), matches.size() * sizeof(FeatureMatch)});
}

std::optional<TwoViewGeometry> Database::ReadTwoViewGeometry(image_pair_t pair_id) const {
  Query query(*impl_,
              "SELECT rows, cols, data, config, F, E, H, qvec, tvec FROM two_view_geometries "
              "WHERE pair_id = ?1;",
              pair_id);
  if (!query.Step()) return std::nullopt;
  const PairRow row{*impl_, query, RowName("two_view_geometries", pair_id)};
  TwoViewGeometry geometry;
  geometry.inlier_matches = MatchesOf(row);
  geometry.config = ConfigFromInt(query.Int(3));
  geometry.F = ReadMatrix3d(row, 4, "F");
  geometry.E = ReadMatrix3d(row, 5, "E");
  geometry.H = ReadMatrix3d(row, 6, "H");
  geometry.cam2_from_cam1 = ReadPose(row, 7);
  return geometry;
}

void Database::WriteTwoViewGeometry(image_pair_t pair_id, const TwoViewGeometry& geometry) {
  const FeatureMatches& inliers = geometry.inlier_matches;
  const std::optional<Rigid3d>& pose = geometry.cam2_from_cam1;
  Run(*impl_,
      "INSERT OR REPLACE INTO two_view_geometries(pair_id, rows, cols, data, config, F, E, H, "
      "qvec, tvec) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10);",
      pair_id, inliers.size(), 2, BoundBlob{inliers.data(), inliers.size() * sizeof(FeatureMatch)},
      static_cast<int>(geometry.config), RowMajor(geometry.F), RowMajor(geometry.E),
      RowMajor(geometry.H), QvecOf(pose), TvecOf(pose));
}

std::vector<PairChoiceRecord> Database::ReadPairChoices() const {
  return ReadRows<std::vector<PairChoiceRecord>>(
      {*impl_, "SELECT pair_id, round, reason FROM cairn_pair_choices WHERE " CAIRN_SQL_USABLE_PAIR
               " ORDER BY pair_id;"},
      [](const Query& row) {
        return PairChoiceRecord{row.Int<image_pair_t>(0), row.Int<int>(1), row.Text(2)};
      });
}

void Database::WritePairChoice(const PairChoiceRecord& choice) {
  Run(*impl_,
      "INSERT OR IGNORE INTO cairn_pair_choices(pair_id, round, reason) VALUES(?1, ?2, ?3);",
      choice.pair_id, choice.round, choice.reason);
}

std::vector<PairMetrics> Database::ReadPairMetrics() const {
  return ReadRows<std::vector<PairMetrics>>(
      {*impl_,
       "SELECT pair_id, verifier, status, is_winner, step, num_matches, num_inliers, "
       "num_iterations, score, residual_px, triangulation_angle_deg, qvec, tvec "
       "FROM cairn_pair_metrics WHERE " CAIRN_SQL_USABLE_PAIR " ORDER BY pair_id, verifier;"},
      [this](const Query& row) { return MetricsFromRow(*impl_, row); });
}

void Database::WritePairMetrics(const PairMetrics& metrics) {
  Run(*impl_,
      "INSERT OR REPLACE INTO cairn_pair_metrics(pair_id, verifier, status, is_winner, step, "
      "num_matches, num_inliers, num_iterations, score, residual_px, triangulation_angle_deg, "
      "qvec, tvec) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13);",
      metrics.pair_id, metrics.verifier, metrics.status, metrics.is_winner, metrics.step,
      metrics.num_matches, metrics.num_inliers, metrics.num_iterations, metrics.score,
      metrics.residual_px, metrics.triangulation_angle_deg, QvecOf(metrics.cam2_from_cam1),
      TvecOf(metrics.cam2_from_cam1));
}

std::map<std::string, int64_t> Database::CountWinners() const {
  return ReadRows<std::map<std::string, int64_t>>(
      {*impl_,
       "SELECT verifier, COUNT(*) FROM cairn_pair_metrics WHERE is_winner "
       "AND " CAIRN_SQL_USABLE_PAIR " GROUP BY verifier;"},
      [](const Query& row) { return std::pair(row.Text(0), row.Int(1)); });
}

std::map<std::string, int64_t> Database::CountRejections() const {
  return ReadRows<std::map<std::string, int64_t>>(
      {*impl_,
       "SELECT note, COUNT(*) FROM (SELECT item AS pair_id, note FROM cairn_jobs "
       "WHERE stage = 'verification' AND note <> '') WHERE " CAIRN_SQL_USABLE_PAIR
       " GROUP BY note;"},
      [](const Query& row) { return std::pair(row.Text(0), row.Int(1)); });
}

std::vector<Database::StepTimes> Database::ReadStepTimes() const {
  return ReadRows<std::vector<StepTimes>>(
      {*impl_,
       "SELECT m.step, COUNT(*), TOTAL(t.seconds) FROM cairn_pair_metrics AS m LEFT JOIN "
       "cairn_timings AS t ON t.stage = 'verification' AND t.item = m.pair_id AND t.label = "
       "m.verifier WHERE m.step <> '' AND " CAIRN_SQL_USABLE_PAIR
       " GROUP BY m.step ORDER BY COUNT(*) DESC, m.step;"},
      [](const Query& row) {
        return StepTimes{row.Text(0), row.Int(1), row.Double(2)};
      });
}

void Database::DeletePairResults(image_pair_t pair_id) {
  Run(*impl_, "DELETE FROM two_view_geometries WHERE pair_id = ?1;", pair_id);
  Run(*impl_, "DELETE FROM cairn_pair_metrics WHERE pair_id = ?1;", pair_id);
}

std::vector<PairFocalEvidence> Database::ReadFocalEvidence() const {
  return ReadRows<std::vector<PairFocalEvidence>>(
      {*impl_,
       "SELECT pair_id, num_matches, num_by_essential, num_by_fundamental FROM "
       "cairn_focal_evidence WHERE " CAIRN_SQL_USABLE_PAIR " ORDER BY pair_id;"},
      [](const Query& row) {
        return PairFocalEvidence{row.Int<image_pair_t>(0), row.Int<int>(1), row.Int<int>(2),
                                 row.Int<int>(3)};
      });
}

void Database::WriteFocalEvidence(const PairFocalEvidence& evidence) {
  Run(*impl_,
      "INSERT OR REPLACE INTO cairn_focal_evidence(pair_id, num_matches, num_by_essential, "
      "num_by_fundamental) VALUES(?1, ?2, ?3, ?4);",
      evidence.pair_id, evidence.num_matches, evidence.num_by_essential,
      evidence.num_by_fundamental);
}

void Database::DeleteFocalEvidence(image_pair_t pair_id) {
  Run(*impl_, "DELETE FROM cairn_focal_evidence WHERE pair_id = ?1;", pair_id);
}

std::map<camera_t, CameraFocal> Database::ReadCameraFocals() const {
  return ReadRows<std::map<camera_t, CameraFocal>>(
      {*impl_,
       "SELECT camera_id, is_refuted, num_pairs, num_refuting FROM cairn_camera_focals "
       "ORDER BY camera_id;"},
      [](const Query& row) {
        return std::pair(row.Int<camera_t>(0),
                         CameraFocal{row.Int<bool>(1), row.Int<int>(2), row.Int<int>(3)});
      });
}

void Database::WriteCameraFocals(const std::map<camera_t, CameraFocal>& focals) {
  impl_->Execute("DELETE FROM cairn_camera_focals;");
  for (const auto& [id, focal] : focals) {
    Run(*impl_,
        "INSERT INTO cairn_camera_focals(camera_id, is_refuted, num_pairs, num_refuting) "
        "VALUES(?1, ?2, ?3, ?4);",
        id, focal.is_rejected, focal.num_pairs, focal.num_contradicting);
  }
}

std::map<camera_t, CameraLens> Database::ReadCameraLenses() const {
  return ReadRows<std::map<camera_t, CameraLens>>(
      {*impl_,
       "SELECT camera_id, focal_px, focal_sigma, is_focal_known, k, k_sigma, num_pairs "
       "FROM cairn_camera_lenses ORDER BY camera_id;"},
      [](const Query& row) {
        return std::pair(row.Int<camera_t>(0),
                         CameraLens{row.Double(1), row.Double(2), row.Int<bool>(3), row.Double(4),
                                    row.Double(5), row.Int<int>(6)});
      });
}

void Database::WriteCameraLens(camera_t camera_id, const CameraLens& lens) {
  Run(*impl_,
      "INSERT OR REPLACE INTO cairn_camera_lenses(camera_id, focal_px, focal_sigma, "
      "is_focal_known, k, k_sigma, num_pairs) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7);",
      camera_id, lens.focal_px, lens.focal_sigma, lens.is_focal_known, lens.k, lens.k_sigma,
      lens.num_pairs);
}

}  // namespace cairn
