#include <cstdint>
#include <cstring>

#include "cairn/base/error.h"
#include "cairn/database/database.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {
namespace {

std::string RowName(const char* table, image_t image_id) {
  return std::string(table) + " of image " + std::to_string(image_id);
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

std::map<image_t, int> NumRowsOfImages(Database::Impl& impl, const char* sql) {
  std::map<image_t, int> num_rows;
  Query query(impl, sql);
  while (query.Step()) {
    num_rows[static_cast<image_t>(query.Int(0))] = static_cast<int>(query.Int(1));
  }
  return num_rows;
}

}  // namespace

std::optional<std::vector<Keypoint>> Database::ReadKeypoints(image_t image_id) const {
  Query query(*impl_, sql::kReadKeypoints, image_id);
  if (!query.Step()) return std::nullopt;
  const std::string row = RowName("keypoints", image_id);
  const MatrixBlob matrix = ReadMatrixBlob(*impl_, query, 0, sizeof(float), row);
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
  Query query(*impl_, sql::kReadDescriptors, image_id);
  if (!query.Step()) return std::nullopt;
  const MatrixBlob matrix =
      ReadMatrixBlob(*impl_, query, 0, sizeof(uint8_t), RowName("descriptors", image_id));
  Descriptors descriptors(matrix.rows, matrix.cols);
  if (descriptors.size() > 0) {
    std::memcpy(descriptors.data(), matrix.data, static_cast<size_t>(descriptors.size()));
  }
  return descriptors;
}

void Database::WriteKeypoints(image_t image_id, const std::vector<Keypoint>& keypoints) {
  Run(*impl_, sql::kWriteKeypoints, image_id, keypoints.size(), 6,
      BoundBlob{keypoints.data(), keypoints.size() * sizeof(Keypoint)});
}

void Database::WriteDescriptors(image_t image_id, const Descriptors& descriptors) {
  const bool typed = impl_->has_descriptor_types;
  Run(*impl_, typed ? sql::kWriteTypedDescriptors : sql::kWriteDescriptors, image_id,
      descriptors.rows(), descriptors.cols(),
      BoundBlob{descriptors.data(), static_cast<size_t>(descriptors.size())});
}

std::map<image_t, int> Database::ReadNumKeypoints() const {
  return NumRowsOfImages(*impl_, sql::kReadNumKeypoints);
}

std::map<image_t, int> Database::ReadNumDescriptors() const {
  return NumRowsOfImages(*impl_, sql::kReadNumDescriptors);
}

}  // namespace cairn
