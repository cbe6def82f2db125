#include <cstring>

#include "cairn/base/error.h"
#include "cairn/base/hash.h"
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
    if (s.is_valid || s.depth < 0) {
      rows.insert(rows.end(), {s.depth, s.ddepth_dx, s.ddepth_dy});
    } else {
      rows.insert(rows.end(), kDepthColumns, 0.0f);
    }
  }
  return rows;
}

}  // namespace

std::optional<std::vector<DepthSample>> Database::ReadDepthSamples(image_t image_id,
                                                                   int scale) const {
  if (!impl_->has_depth_tables) return std::nullopt;
  Query query(*impl_, sql::kReadDepthSamples);
  if (!query.Bind(1, image_id).Bind(2, scale).Step()) return std::nullopt;
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
  if (!impl_->has_depth_tables) return std::nullopt;
  Query query(*impl_, sql::kReadDepthHash);
  if (!query.Bind(1, image_id).Step()) return std::nullopt;
  return static_cast<uint64_t>(query.Int(0));
}

void Database::WriteDepthSamples(image_t image_id, const std::vector<DepthSample>& samples) {
  WriteDepthScales(image_id, {samples});
}

void Database::WriteDepthScales(image_t image_id,
                                const std::vector<std::vector<DepthSample>>& scales) {
  std::vector<std::vector<float>> rows;
  Hasher hasher;
  for (const std::vector<DepthSample>& samples : scales) {
    rows.push_back(DepthRows(samples));
    hasher.AddBytes(rows.back().data(), rows.back().size() * sizeof(float));
  }
  Query(*impl_, sql::kDeleteDepthSamples).Bind(1, image_id).Run();
  for (size_t scale = 0; scale < rows.size(); ++scale) {
    Query(*impl_, sql::kWriteDepthSamples)
        .Bind(1, image_id)
        .Bind(2, static_cast<uint64_t>(scale))
        .Bind(3, hasher.Digest())
        .Bind(4, static_cast<uint64_t>(scales[scale].size()))
        .Bind(5, kDepthColumns)
        .BindBlob(6, rows[scale].data(), rows[scale].size() * sizeof(float))
        .Run();
  }
}

std::map<image_t, int> Database::ReadNumDepthSamples() const {
  std::map<image_t, int> num_samples;
  if (!impl_->has_depth_tables) return num_samples;
  Query query(*impl_, sql::kReadNumDepthSamples);
  while (query.Step()) {
    num_samples[static_cast<image_t>(query.Int(0))] = static_cast<int>(query.Int(1));
  }
  return num_samples;
}

std::map<image_t, ImageDepth> Database::ReadImageDepth() const {
  std::map<image_t, ImageDepth> learned;
  if (!impl_->has_depth_tables) return learned;
  Query query(*impl_, sql::kReadImageDepth);
  while (query.Step()) {
    learned[static_cast<image_t>(query.Int(0))] = {static_cast<int>(query.Int(1)), query.Double(2),
                                                   query.Int(3), query.Int(4)};
  }
  return learned;
}

void Database::WriteImageDepth(image_t image_id, const ImageDepth& depth) {
  Query(*impl_, sql::kWriteImageDepth)
      .Bind(1, image_id)
      .Bind(2, depth.scale)
      .Bind(3, depth.shift)
      .Bind(4, depth.num_hypotheses)
      .Bind(5, depth.num_right)
      .Run();
}

}  // namespace cairn
