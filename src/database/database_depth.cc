#include <cstring>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/database/database.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {
namespace {

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

std::optional<std::vector<DepthSample>> Database::ReadDepthSamples(image_t image_id) const {
  Query query(*impl_, sql::kReadDepthSamples, image_id);
  if (!query.Step()) return std::nullopt;
  const std::string row = "cairn_depth_scales of image " + std::to_string(image_id);
  const MatrixBlob matrix = ReadMatrixBlob(*impl_, query, 0, sizeof(float), row);
  if (matrix.cols != kDepthColumns) {
    throw IoError(path(), row + ": " + std::to_string(matrix.cols) + " columns instead of 3");
  }
  std::vector<DepthSample> samples(static_cast<size_t>(matrix.rows));
  for (size_t i = 0; i < samples.size(); ++i) {
    float values[kDepthColumns];
    std::memcpy(values, matrix.data + i * sizeof(values), sizeof(values));
    samples[i] = {values[0], values[1], values[2], values[0] > 0};
  }
  return samples;
}

std::optional<uint64_t> Database::ReadDepthHash(image_t image_id) const {
  Query query(*impl_, sql::kReadDepthHash, image_id);
  if (!query.Step()) return std::nullopt;
  return static_cast<uint64_t>(query.Int(0));
}

void Database::WriteDepthSamples(image_t image_id, const std::vector<DepthSample>& samples) {
  const std::vector<float> rows = DepthRows(samples);
  const size_t num_bytes = rows.size() * sizeof(float);
  Run(*impl_, sql::kDeleteDepthSamples, image_id);
  Run(*impl_, sql::kWriteDepthSamples, image_id, Hasher().AddBytes(rows.data(), num_bytes).Digest(),
      samples.size(), kDepthColumns, BoundBlob{rows.data(), num_bytes});
}

std::map<image_t, int> Database::ReadNumDepthSamples() const {
  std::map<image_t, int> num_samples;
  Query query(*impl_, sql::kReadNumDepthSamples);
  while (query.Step()) {
    num_samples[static_cast<image_t>(query.Int(0))] = static_cast<int>(query.Int(1));
  }
  return num_samples;
}

}  // namespace cairn
