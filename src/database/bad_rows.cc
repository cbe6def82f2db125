#include "database/bad_rows.h"

#include <cstring>

#include "cairn/database/report_bad_rows.h"
#include "cairn/scene/image.h"
#include "database/sql.h"
#include "report/stage.h"

namespace cairn {
namespace {

#define CAIRN_SQL_BAD_PAIRS(table) \
  "SELECT pair_id FROM " table " WHERE NOT " CAIRN_SQL_USABLE_PAIR " ORDER BY pair_id;"
#define CAIRN_SQL_BAD_IMAGE_ROWS(table) \
  "SELECT image_id FROM " table " WHERE NOT " CAIRN_SQL_USABLE_IMAGE " ORDER BY image_id;"

struct Table {
  const char* name;
  const char* sql;
};
constexpr Table kPairTables[] = {
    {"matches", CAIRN_SQL_BAD_PAIRS("matches")},
    {"two_view_geometries", CAIRN_SQL_BAD_PAIRS("two_view_geometries")},
    {"cairn_pair_metrics", CAIRN_SQL_BAD_PAIRS("cairn_pair_metrics")}};
constexpr Table kImageTables[] = {{"keypoints", CAIRN_SQL_BAD_IMAGE_ROWS("keypoints")},
                                  {"descriptors", CAIRN_SQL_BAD_IMAGE_ROWS("descriptors")}};

// Why the row of a pair cannot be used.
std::string ReasonAgainstPair(int64_t pair_id) {
  constexpr int64_t kBase = kMaxNumImages;
  if (pair_id < 0) return "the id is negative";
  const int64_t id1 = pair_id / kBase, id2 = pair_id % kBase;
  if (id1 == id2) return "an image is paired with itself";
  if (id1 > id2) return "the larger image id is first";
  return "there is no such image";
}

}  // namespace

std::string ReasonAgainstImage(int64_t image_id, const std::string& name, int64_t camera_id) {
  if (image_id < 0 || image_id >= static_cast<int64_t>(kMaxNumImages)) {
    return "the id is out of range";
  }
  if (name.empty()) return "the name is empty";
  if (!IsImageName(name)) return "the name has a line break or a zero byte";
  const bool is_camera_id = camera_id >= 0 && camera_id < kInvalidCameraId;
  return is_camera_id ? "" : "the camera's id is out of range";
}

CameraRow ReadCameraRow(const Query& query) {
  CameraRow row;
  Camera& camera = row.camera;
  camera.camera_id = query.Int<camera_t>(0);
  const auto is_int = [&](int column) { return query.Int(column) == query.Int<int>(column); };
  const std::optional<CameraModel> model =
      is_int(1) ? CameraModelFromId(query.Int<int>(1)) : std::nullopt;
  row.is_known_model = model.has_value();
  if (query.Int(0) < 0 || query.Int(0) >= kInvalidCameraId) row.bad = "the id is out of range";
  if (!model || !row.bad.empty()) return row;
  if (!is_int(2) || !is_int(3)) {
    row.bad = "the size is out of range";
    return row;
  }
  camera.model = *model;
  camera.width = query.Int<int>(2);
  camera.height = query.Int<int>(3);
  const std::span<const std::byte> blob = query.Blob(4);
  const size_t expected = CameraModelNumParams(*model) * sizeof(double);
  if (blob.size() != expected) {
    row.bad = "its params blob has " + std::to_string(blob.size()) + " bytes, its model needs " +
              std::to_string(expected);
    return row;
  }
  camera.params.resize(blob.size() / sizeof(double));
  std::memcpy(camera.params.data(), blob.data(), blob.size());
  camera.has_prior_focal_length = query.Int<bool>(5);
  row.bad = camera.Validate();
  return row;
}

std::string PairRowName(const char* table, int64_t pair_id) {
  constexpr int64_t kBase = kMaxNumImages;
  return std::string(table) + " of pair " + std::to_string(pair_id) + " (images " +
         std::to_string(pair_id / kBase) + ", " + std::to_string(pair_id % kBase) + ")";
}

std::vector<std::string> Database::FindBadRows() const {
  std::vector<std::string> bad;
  {
    Query query(*impl_, sql::kReadCameras);
    while (query.Step()) {
      const CameraRow row = ReadCameraRow(query);
      if (!row.bad.empty()) bad.push_back("camera " + query.Text(0) + ": " + row.bad);
    }
  }
  {
    Query query(*impl_,
                "SELECT image_id, name, camera_id FROM images WHERE NOT " CAIRN_SQL_USABLE_IMAGE
                " ORDER BY image_id;");
    while (query.Step()) {
      bad.push_back("image " + query.Text(0) + ": " +
                    ReasonAgainstImage(query.Int(0), query.Text(1), query.Int(2)));
    }
  }
  if (impl_->has_rigs) {  // COLMAP 4.x
    Query query(*impl_,
                "SELECT DISTINCT rig_id FROM rig_sensors WHERE sensor_type = 0 ORDER BY rig_id;");
    while (query.Step()) {
      bad.push_back("rig_sensors of rig " + query.Text(0) +
                    ": cameras that are fixed to each other are not known as such");
    }
  }
  for (const Table& table : kImageTables) {
    Query query(*impl_, table.sql);
    while (query.Step()) {
      bad.push_back(std::string(table.name) + " of image " + query.Text(0) +
                    ": there is no such image");
    }
  }
  for (const Table& table : kPairTables) {
    Query query(*impl_, table.sql);
    while (query.Step()) {
      bad.push_back(PairRowName(table.name, query.Int(0)) + ": " + ReasonAgainstPair(query.Int(0)));
    }
  }
  return bad;
}

void ReportBadRows(const Database& database, RunReport& report, ProgressMonitor& monitor) {
  std::vector<std::string> bad = database.FindBadRows();
  if (bad.empty()) return;
  RunStage stage(report, monitor, "database");
  stage.Add("bad_rows", bad.size());
  for (std::string& row : bad) row = database.path() + ": " + row + "; the row is left out";
  stage.WarnEach(bad);
}

}  // namespace cairn
