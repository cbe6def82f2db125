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

FeatureMatches MatchesFromBlob(const Database::Impl& impl, const Query& query,
                               const std::string& row_name) {
  const MatrixBlob matrix = ReadMatrixBlob(impl, query, 0, sizeof(uint32_t), row_name);
  FeatureMatches matches(static_cast<size_t>(matrix.rows));
  if (matches.empty()) return matches;
  if (matrix.cols != 2) {
    throw IoError(impl.path,
                  row_name + ": " + std::to_string(matrix.cols) + " columns instead of 2");
  }
  static_assert(sizeof(FeatureMatch) == 2 * sizeof(uint32_t));
  std::memcpy(static_cast<void*>(matches.data()), matrix.data,
              matches.size() * sizeof(FeatureMatch));
  return matches;
}

// Fills `values` from the column's blob; false where it is NULL or empty.
template <size_t n>
bool ReadDoubles(const Database::Impl& impl, const Query& query, int column,
                 const std::string& row_name, const char* column_name, double (&values)[n]) {
  const std::span<const std::byte> blob = query.Blob(column);
  if (blob.empty()) return false;
  if (blob.size() != sizeof(values)) {
    throw IoError(impl.path, row_name + ": " + column_name + " needs " +
                                 std::to_string(sizeof(values)) + " bytes, but the blob has " +
                                 std::to_string(blob.size()));
  }
  std::memcpy(values, blob.data(), sizeof(values));
  for (const double value : values) {
    if (std::isfinite(value)) continue;
    throw IoError(impl.path, row_name + ": " + column_name + " has a value that is not finite");
  }
  return true;
}

std::optional<Eigen::Matrix3d> ReadMatrix3d(const Database::Impl& impl, const Query& query,
                                            int column, const std::string& row_name,
                                            const char* column_name) {
  double values[9];
  if (!ReadDoubles(impl, query, column, row_name, column_name, values)) return std::nullopt;
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

std::optional<Rigid3d> ReadPose(const Database::Impl& impl, const Query& query, int qvec_column,
                                const std::string& row_name) {
  double q[4];
  double t[3];
  if (!ReadDoubles(impl, query, qvec_column, row_name, "qvec", q)) return std::nullopt;
  if (!ReadDoubles(impl, query, qvec_column + 1, row_name, "tvec", t)) return std::nullopt;
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  const Eigen::Vector3d translation(t[0], t[1], t[2]);
  if (rotation.coeffs().isZero(0)) return std::nullopt;
  if (!HasNorm(rotation.coeffs()) || (!translation.isZero(0) && !HasNorm(translation))) {
    throw IoError(impl.path, row_name + ": its pose has a number that is too large or too small");
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

std::vector<std::pair<image_pair_t, int>> NumRowsOfPairs(Database::Impl& impl, const char* sql) {
  std::vector<std::pair<image_pair_t, int>> num_rows;
  Query query(impl, sql);
  while (query.Step()) {
    num_rows.emplace_back(static_cast<image_pair_t>(query.Int(0)), static_cast<int>(query.Int(1)));
  }
  return num_rows;
}

std::vector<image_pair_t> IdsWithRows(const std::vector<std::pair<image_pair_t, int>>& num_rows) {
  std::vector<image_pair_t> ids;
  for (const auto& [pair_id, rows] : num_rows) {
    if (rows > 0) ids.push_back(pair_id);
  }
  return ids;
}

PairMetrics MetricsFromRow(const Database::Impl& impl, const Query& query) {
  PairMetrics m;
  m.pair_id = static_cast<image_pair_t>(query.Int(0));
  m.verifier = query.Text(1);
  m.status = query.Text(2);
  m.is_winner = query.Int(3) != 0;
  m.step = query.Text(4);
  m.num_matches = static_cast<int>(query.Int(5));
  m.num_inliers = static_cast<int>(query.Int(6));
  m.num_iterations = query.Int(7);
  m.score = query.Double(8);
  m.residual_px = query.Double(9);
  m.triangulation_angle_deg = query.Double(10);
  try {
    m.cam2_from_cam1 = ReadPose(impl, query, 11, RowName("cairn_pair_metrics", m.pair_id));
  } catch (const IoError&) {  // a figure for people, which the row can do without
  }
  return m;
}

}  // namespace

std::vector<std::pair<image_pair_t, int>> Database::ReadNumMatches() const {
  return NumRowsOfPairs(*impl_, sql::kReadNumMatches);
}

std::vector<std::pair<image_pair_t, int>> Database::ReadNumInliers() const {
  return NumRowsOfPairs(*impl_, sql::kReadNumInliers);
}

std::vector<image_pair_t> Database::ReadMatchedPairIds() const {
  return IdsWithRows(ReadNumMatches());
}

std::vector<image_pair_t> Database::ReadTwoViewGeometryPairIds() const {
  return IdsWithRows(ReadNumInliers());
}

std::optional<FeatureMatches> Database::ReadMatches(image_pair_t pair_id) const {
  Query query(*impl_, sql::kReadMatches, pair_id);
  if (!query.Step()) return std::nullopt;
  return MatchesFromBlob(*impl_, query, RowName("matches", pair_id));
}

void Database::WriteMatches(image_pair_t pair_id, const FeatureMatches& matches) {
  Run(*impl_, sql::kWriteMatches, pair_id, matches.size(), 2,
      BoundBlob{matches.data(), matches.size() * sizeof(FeatureMatch)});
}

std::optional<TwoViewGeometry> Database::ReadTwoViewGeometry(image_pair_t pair_id) const {
  Query query(*impl_, sql::kReadTwoViewGeometry, pair_id);
  if (!query.Step()) return std::nullopt;
  const std::string row = RowName("two_view_geometries", pair_id);
  TwoViewGeometry geometry;
  geometry.inlier_matches = MatchesFromBlob(*impl_, query, row);
  geometry.config = ConfigFromInt(query.Int(3));
  geometry.F = ReadMatrix3d(*impl_, query, 4, row, "F");
  geometry.E = ReadMatrix3d(*impl_, query, 5, row, "E");
  geometry.H = ReadMatrix3d(*impl_, query, 6, row, "H");
  geometry.cam2_from_cam1 = ReadPose(*impl_, query, 7, row);
  return geometry;
}

void Database::WriteTwoViewGeometry(image_pair_t pair_id, const TwoViewGeometry& geometry) {
  const FeatureMatches& inliers = geometry.inlier_matches;
  const std::optional<Rigid3d>& pose = geometry.cam2_from_cam1;
  Run(*impl_, sql::kWriteTwoViewGeometry, pair_id, inliers.size(), 2,
      BoundBlob{inliers.data(), inliers.size() * sizeof(FeatureMatch)},
      static_cast<int>(geometry.config), RowMajor(geometry.F), RowMajor(geometry.E),
      RowMajor(geometry.H), QvecOf(pose), TvecOf(pose));
}

std::vector<PairChoiceRecord> Database::ReadPairChoices() const {
  std::vector<PairChoiceRecord> choices;
  Query query(*impl_, sql::kReadPairChoices);
  while (query.Step()) {
    choices.push_back(
        {static_cast<image_pair_t>(query.Int(0)), static_cast<int>(query.Int(1)), query.Text(2)});
  }
  return choices;
}

void Database::WritePairChoice(const PairChoiceRecord& choice) {
  Run(*impl_, sql::kWritePairChoice, choice.pair_id, choice.round, choice.reason);
}

std::vector<PairMetrics> Database::ReadPairMetrics() const {
  std::vector<PairMetrics> metrics;
  Query query(*impl_, sql::kReadAllPairMetrics);
  while (query.Step()) metrics.push_back(MetricsFromRow(*impl_, query));
  return metrics;
}

std::vector<PairMetrics> Database::ReadPairMetrics(image_pair_t pair_id) const {
  std::vector<PairMetrics> metrics;
  Query query(*impl_, sql::kReadPairMetrics, pair_id);
  while (query.Step()) metrics.push_back(MetricsFromRow(*impl_, query));
  return metrics;
}

std::map<std::string, int64_t> Database::CountWinners() const {
  std::map<std::string, int64_t> counts;
  Query query(*impl_, sql::kCountWinners);
  while (query.Step()) counts[query.Text(0)] = query.Int(1);
  return counts;
}

std::vector<Database::StepTimes> Database::ReadStepTimes() const {
  std::vector<StepTimes> steps;
  Query query(*impl_, sql::kReadStepTimes);
  while (query.Step()) steps.push_back({query.Text(0), query.Int(1), query.Double(2)});
  return steps;
}

void Database::WritePairMetrics(const PairMetrics& metrics) {
  Run(*impl_, sql::kWritePairMetrics, metrics.pair_id, metrics.verifier, metrics.status,
      metrics.is_winner, metrics.step, metrics.num_matches, metrics.num_inliers,
      metrics.num_iterations, metrics.score, metrics.residual_px, metrics.triangulation_angle_deg,
      QvecOf(metrics.cam2_from_cam1), TvecOf(metrics.cam2_from_cam1));
}

}  // namespace cairn
