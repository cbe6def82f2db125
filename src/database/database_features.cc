#include <algorithm>
#include <cstdint>
#include <cstring>

#include "base/hash.h"
#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/database/database.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {
namespace {

std::string RowName(const char* table, image_t image_id) {
  return std::string(table) + " of image " + std::to_string(image_id);
}

// Throws IoError unless there is the image that a row is to be written of.
void CheckImage(const Database& database, const char* table, image_t image_id) {
  if (database.HasImage(image_id)) return;
  throw IoError(database.path(), RowName(table, image_id) + ": there is no such image");
}

// COLMAP's rows: x y | x y scale orientation | x y a11 a12 a21 a22, which is ours.
Keypoint KeypointFromRow(const float* row, int64_t cols) {
  if (cols == 2) return {row[0], row[1]};
  return Keypoint::FromScaleOrientation(row[0], row[1], row[2], row[3]);
}

bool AreFinite(const std::byte* floats, size_t n) {
  constexpr uint32_t kExponent = 0x7f800000;
  uint32_t any = 0;
  for (size_t i = 0; i < n; ++i) {
    uint32_t bits;
    std::memcpy(&bits, floats + i * sizeof(bits), sizeof(bits));
    any |= (bits & kExponent) == kExponent ? 1 : 0;
  }
  return any == 0;
}

std::map<image_t, int> ReadNumRows(Query&& query) {
  return ReadRows<std::map<image_t, int>>(std::move(query), [](const Query& row) {
    return std::pair(row.Int<image_t>(0), row.Int<int>(1));
  });
}

// A stored depth sample: depth, ddepth_dx, ddepth_dy. Valid where depth is positive; 0: missing.
constexpr int kDepthColumns = 3;

std::vector<float> DepthRows(const std::vector<DepthSample>& samples) {
  std::vector<float> rows;
  rows.reserve(samples.size() * kDepthColumns);
  for (const DepthSample& s : samples) {
    if (s.is_valid) {
      rows.insert(rows.end(), {s.depth, s.ddepth_dx, s.ddepth_dy});
    } else {
      rows.insert(rows.end(), kDepthColumns, 0.0f);
    }
  }
  return rows;
}

}  // namespace

std::optional<std::vector<Keypoint>> Database::ReadKeypoints(image_t image_id) const {
  Query query(*impl_, "SELECT rows, cols, data FROM keypoints WHERE image_id = ?1;", image_id);
  if (!query.Step()) return std::nullopt;
  const std::string row = RowName("keypoints", image_id);
  const MatrixBlob matrix = ReadMatrixBlob(*impl_, query, sizeof(float), row);
  std::vector<Keypoint> keypoints(static_cast<size_t>(matrix.rows));
  if (keypoints.empty()) return keypoints;
  if (matrix.cols != 2 && matrix.cols != 4 && matrix.cols != 6) {
    throw IoError(path(),
                  row + ": " + std::to_string(matrix.cols) + " columns; 2, 4 or 6 are known");
  }
  if (!AreFinite(matrix.data, keypoints.size() * static_cast<size_t>(matrix.cols))) {
    throw IoError(path(), row + ": a value is not finite");
  }
  const size_t num_bytes = static_cast<size_t>(matrix.cols) * sizeof(float);
  static_assert(sizeof(Keypoint) == 6 * sizeof(float));
  if (matrix.cols == 6) {
    std::memcpy(static_cast<void*>(keypoints.data()), matrix.data, keypoints.size() * num_bytes);
    return keypoints;
  }
  for (int64_t i = 0; i < matrix.rows; ++i) {
    float values[4];
    std::memcpy(values, matrix.data + i * num_bytes, num_bytes);
    keypoints[i] = KeypointFromRow(values, matrix.cols);
  }
  return keypoints;
}

std::optional<Descriptors> Database::ReadDescriptors(image_t image_id) const {
  Query query(*impl_, "SELECT rows, cols, data FROM descriptors WHERE image_id = ?1;", image_id);
  if (!query.Step()) return std::nullopt;
  const std::string row = RowName("descriptors", image_id);
  const MatrixBlob matrix = ReadMatrixBlob(*impl_, query, sizeof(uint8_t), row);
  Descriptors descriptors(matrix.rows, matrix.cols);
  if (descriptors.size() > 0 && matrix.cols != kDescriptorSize) {
    throw IoError(path(), row + ": " + std::to_string(matrix.cols) + " columns instead of " +
                              std::to_string(kDescriptorSize));
  }
  if (descriptors.size() > 0) {
    std::memcpy(descriptors.data(), matrix.data, static_cast<size_t>(descriptors.size()));
  }
  return descriptors;
}

Polarities Database::ReadPolarities(image_t image_id, const Descriptors& descriptors) const {
  Query query(*impl_, "SELECT hash, data FROM cairn_polarities WHERE image_id = ?1;", image_id);
  if (!query.Step() || query.Int<uint64_t>(0) != HashValues(descriptors)) return {};
  const std::span<const std::byte> data = query.Blob(1);
  Polarities polarities(data.size());
  if (!data.empty()) std::memcpy(polarities.data(), data.data(), data.size());
  if (std::ssize(polarities) != descriptors.rows() ||
      std::ranges::any_of(polarities, [](uint8_t polarity) { return polarity > 1; })) {
    throw IoError(path(), RowName("cairn_polarities", image_id) + ": not a 0 or 1 a descriptor");
  }
  return polarities;
}

std::optional<std::vector<DepthSample>> Database::ReadDepthSamples(image_t image_id) const {
  Query query(*impl_,
              "SELECT rows, cols, data FROM cairn_depth_scales WHERE image_id = ?1 AND scale = 0;",
              image_id);
  if (!query.Step()) return std::nullopt;
  const std::string row = RowName("cairn_depth_scales", image_id);
  const MatrixBlob matrix = ReadMatrixBlob(*impl_, query, sizeof(float), row);
  if (matrix.cols != kDepthColumns) {
    throw IoError(path(), row + ": " + std::to_string(matrix.cols) + " columns instead of 3");
  }
  std::vector<DepthSample> samples(static_cast<size_t>(matrix.rows));
  if (!AreFinite(matrix.data, samples.size() * kDepthColumns)) {
    throw IoError(path(), row + ": a value is not finite");
  }
  for (size_t i = 0; i < samples.size(); ++i) {
    float values[kDepthColumns];
    std::memcpy(values, matrix.data + i * sizeof(values), sizeof(values));
    samples[i] = {values[0], values[1], values[2], values[0] > 0};
  }
  return samples;
}

std::optional<uint64_t> Database::ReadDepthHash(image_t image_id) const {
  Query query(*impl_, "SELECT hash FROM cairn_depth_scales WHERE image_id = ?1 AND scale = 0;",
              image_id);
  if (!query.Step()) return std::nullopt;
  return query.Int<uint64_t>(0);
}

void Database::WriteKeypoints(image_t image_id, const std::vector<Keypoint>& keypoints) {
  CheckImage(*this, "keypoints", image_id);
  Run(*impl_,
      "INSERT OR REPLACE INTO keypoints(image_id, rows, cols, data) VALUES(?1, ?2, ?3, ?4);",
      image_id, keypoints.size(), 6,
      BoundBlob{keypoints.data(), keypoints.size() * sizeof(Keypoint)});
}

void Database::WriteDescriptors(image_t image_id, const Descriptors& descriptors,
                                const Polarities& polarities) {
  CheckImage(*this, "descriptors", image_id);
  // In COLMAP 4.x descriptors have a type; 0 is SIFT.
  Run(*impl_,
      impl_->has_descriptor_types
          ? "INSERT OR REPLACE INTO descriptors(image_id, rows, cols, data, type) "
            "VALUES(?1, ?2, ?3, ?4, 0);"
          : "INSERT OR REPLACE INTO descriptors(image_id, rows, cols, data) "
            "VALUES(?1, ?2, ?3, ?4);",
      image_id, descriptors.rows(), descriptors.cols(),
      BoundBlob{descriptors.data(), static_cast<size_t>(descriptors.size())});
  if (polarities.empty()) {
    Run(*impl_, "DELETE FROM cairn_polarities WHERE image_id = ?1;", image_id);
    return;
  }
  CAIRN_CHECK_EQ(std::ssize(polarities), descriptors.rows());
  Run(*impl_, "INSERT OR REPLACE INTO cairn_polarities(image_id, hash, data) VALUES(?1, ?2, ?3);",
      image_id, HashValues(descriptors), BoundBlob{polarities.data(), polarities.size()});
}

void Database::WriteDepthSamples(image_t image_id, const std::vector<DepthSample>& samples) {
  CheckImage(*this, "cairn_depth_scales", image_id);
  const std::vector<float> rows = DepthRows(samples);
  Run(*impl_,
      "INSERT OR REPLACE INTO cairn_depth_scales(image_id, scale, hash, rows, cols, data) "
      "VALUES(?1, 0, ?2, ?3, ?4, ?5);",
      image_id, HashValues(rows), samples.size(), kDepthColumns,
      BoundBlob{rows.data(), rows.size() * sizeof(float)});
}

std::optional<int> Database::ReadNumKeypoints(image_t image_id) const {
  Query query(*impl_, "SELECT rows FROM keypoints WHERE image_id = ?1;", image_id);
  if (!query.Step()) return std::nullopt;
  return query.Int<int>(0);
}

std::map<image_t, int> Database::ReadNumKeypoints() const {
  return ReadNumRows(
      {*impl_, "SELECT image_id, rows FROM keypoints WHERE " CAIRN_SQL_USABLE_IMAGE ";"});
}

std::map<image_t, int> Database::ReadNumDescriptors() const {
  return ReadNumRows(
      {*impl_, "SELECT image_id, rows FROM descriptors WHERE " CAIRN_SQL_USABLE_IMAGE ";"});
}

std::map<image_t, int> Database::ReadNumDepthSamples() const {
  return ReadNumRows({*impl_,
                      "SELECT image_id, rows FROM cairn_depth_scales WHERE scale = 0 "
                      "AND " CAIRN_SQL_USABLE_IMAGE ";"});
}

}  // namespace cairn
