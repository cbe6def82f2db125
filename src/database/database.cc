#include "cairn/database/database.h"

#include "cairn/base/error.h"
#include "database/bad_rows.h"
#include "database/query.h"
#include "database/sql.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

// COLMAP 4.x: each camera is the reference sensor (type 0) of a rig of its own, each image a frame.

// The camera's rig, made if there is none.
int64_t RigOfCamera(Database::Impl& impl, camera_t camera_id) {
  for (int attempt = 0; attempt < 2; ++attempt) {
    for (const char* sql :
         {"SELECT rig_id FROM rigs WHERE ref_sensor_id = ?1 AND ref_sensor_type = 0;",
          "SELECT rig_id FROM rig_sensors WHERE sensor_id = ?1 AND sensor_type = 0;"}) {
      Query query(impl, sql, camera_id);
      if (query.Step()) return query.Int(0);
    }
    if (attempt > 0) break;
    Run(impl,
        "INSERT INTO rigs(rig_id, ref_sensor_id, ref_sensor_type) "
        "VALUES((SELECT COALESCE(MAX(rig_id), 0) + 1 FROM rigs), ?1, 0);",
        camera_id);
  }
  throw BugError("a rig was written and cannot be found");
}

struct FrameRow {
  int64_t frame_id = 0;
  int64_t sensor_id = 0;
};

std::optional<FrameRow> ReadFrame(Database::Impl& impl, image_t image_id) {
  Query query(impl,
              "SELECT frame_id, sensor_id FROM frame_data WHERE data_id = ?1 AND sensor_type = 0;",
              image_id);
  if (!query.Step()) return std::nullopt;
  return FrameRow{query.Int(0), query.Int(1)};
}

// Takes the image out of its frame, which goes where it held nothing else.
void DeleteFrame(Database::Impl& impl, image_t image_id) {
  const std::optional<FrameRow> frame = ReadFrame(impl, image_id);
  if (!frame) return;
  Run(impl, "DELETE FROM frame_data WHERE data_id = ?1 AND sensor_type = 0;", image_id);
  Run(impl,
      "DELETE FROM frames WHERE frame_id = ?1 "
      "AND NOT EXISTS (SELECT 1 FROM frame_data WHERE frame_id = ?1);",
      frame->frame_id);
}

#define CAIRN_SQL_OF_RIGS_OF_CAMERA                                                             \
  " WHERE rig_id IN (SELECT rig_id FROM rigs WHERE ref_sensor_id = ?1 AND ref_sensor_type = 0 " \
  "UNION SELECT rig_id FROM rig_sensors WHERE sensor_id = ?1 AND sensor_type = 0);"

// Removes a camera that no image has, with its rig, unless a frame of that is left: then other
// images need the rig, and the rig its cameras.
void DeleteUnusedCamera(Database::Impl& impl, camera_t camera_id) {
  if (impl.has_rigs) {
    Query frame(impl, "SELECT 1 FROM frames" CAIRN_SQL_OF_RIGS_OF_CAMERA, camera_id);
    if (frame.Step()) return;
    Run(impl, "DELETE FROM rigs" CAIRN_SQL_OF_RIGS_OF_CAMERA, camera_id);
  }
  Run(impl, "DELETE FROM cameras WHERE camera_id = ?1;", camera_id);
}

// A frame of its own for the image, unless it has one.
void EnsureFrame(Database::Impl& impl, const Image& image) {
  const std::optional<FrameRow> frame = ReadFrame(impl, image.image_id);
  if (frame && frame->sensor_id == image.camera_id) return;
  DeleteFrame(impl, image.image_id);
  Run(impl,
      "INSERT INTO frames(frame_id, rig_id) "
      "VALUES((SELECT COALESCE(MAX(frame_id), 0) + 1 FROM frames), ?1);",
      RigOfCamera(impl, image.camera_id));
  Run(impl,
      "INSERT INTO frame_data(frame_id, data_id, sensor_id, sensor_type) "
      "VALUES((SELECT MAX(frame_id) FROM frames), ?1, ?2, 0);",
      image.image_id, image.camera_id);
}

// Throws IoError for an image that cannot be written.
void CheckImageRow(Database::Impl& impl, const Image& image) {
  std::string reason = ReasonAgainstImage(image.image_id, image.name, image.camera_id);
  if (reason.empty() &&
      !Query(impl, "SELECT 1 FROM cameras WHERE camera_id = ?1;", image.camera_id).Step()) {
    reason = "there is no camera " + std::to_string(image.camera_id);
  }
  Query other(impl, "SELECT image_id FROM images WHERE name = ?1 AND image_id <> ?2;", image.name,
              image.image_id);
  if (reason.empty() && other.Step()) {
    reason = "image " + other.Text(0) + " has its name, '" + image.name + "'";
  }
  if (reason.empty()) return;
  throw IoError(impl.path, "image " + std::to_string(image.image_id) + ": " + reason);
}

}  // namespace

Database::Database(const std::string& path, Mode mode) : impl_(OpenConnection(path, mode)) {}
Database::~Database() = default;
Database::Database(Database&&) noexcept = default;
Database& Database::operator=(Database&&) noexcept = default;

const std::string& Database::path() const { return impl_->path; }

void Database::SetBusyTimeout(int milliseconds) {
  sqlite3_busy_timeout(impl_->connection, milliseconds);
}

std::vector<Camera> Database::ReadCameras() const {
  std::vector<Camera> cameras;
  Query query(*impl_, sql::kReadCameras);
  while (query.Step()) {
    CameraRow row = ReadCameraRow(query);
    if (row.is_known_model && row.bad.empty()) cameras.push_back(std::move(row.camera));
  }
  return cameras;
}

std::vector<UnknownCamera> Database::ReadUnknownCameras() const {
  std::vector<UnknownCamera> cameras;
  Query query(*impl_, sql::kReadCameras);
  while (query.Step()) {
    if (ReadCameraRow(query).is_known_model) continue;
    cameras.push_back({.camera_id = query.Int<camera_t>(0),
                       .model_id = query.Int(1),
                       .width = query.Int<int>(2),
                       .height = query.Int<int>(3)});
  }
  return cameras;
}

std::vector<Image> Database::ReadImages() const {
  return ReadRows<std::vector<Image>>(
      {*impl_, "SELECT image_id, name, camera_id FROM usable_images ORDER BY image_id;"},
      [](const Query& row) {
        return Image{row.Int<image_t>(0), row.Text(1), row.Int<camera_t>(2)};
      });
}

std::vector<camera_t> Database::ReadTakenCameraIds() const {
  return ReadRows<std::vector<camera_t>>(
      {*impl_,
       "SELECT camera_id FROM cameras WHERE camera_id >= 0 AND camera_id < 4294967295 "
       "ORDER BY camera_id;"},
      [](const Query& row) { return row.Int<camera_t>(0); });
}

image_t Database::ReadLargestTakenImageId() const {
  Query query(*impl_,
              "SELECT COALESCE(MAX(image_id), 0) FROM images "
              "WHERE image_id >= 0 AND image_id < 2147483647;");
  query.Step();
  const auto largest = query.Int<image_t>(0);
  if (largest == 0 ||
      !Query(*impl_, "SELECT 1 FROM sqlite_master WHERE name = 'sqlite_sequence';").Step()) {
    return largest;
  }
  Query sequence(*impl_,
                 "SELECT COALESCE(MAX(seq), 0) FROM sqlite_sequence "
                 "WHERE name = 'images' AND seq >= 0 AND seq < 2147483647;");
  sequence.Step();
  return std::max(largest, sequence.Int<image_t>(0));
}

bool Database::HasImage(image_t image_id) const {
  return Query(*impl_, "SELECT 1 FROM usable_images WHERE image_id = ?1;", image_id).Step();
}

void Database::WriteCamera(const Camera& camera) {
  if (camera.camera_id == kInvalidCameraId) {
    throw IoError(path(), "cameras have ids below " + std::to_string(kInvalidCameraId));
  }
  Run(*impl_,
      "INSERT INTO cameras(camera_id, model, width, height, params, prior_focal_length) "
      "VALUES(?1, ?2, ?3, ?4, ?5, ?6) ON CONFLICT(camera_id) DO UPDATE SET model = ?2, width = ?3, "
      "height = ?4, params = ?5, prior_focal_length = ?6;",
      camera.camera_id, static_cast<int>(camera.model), camera.width, camera.height,
      BoundBlob{camera.params.data(), camera.params.size() * sizeof(double)},
      camera.has_prior_focal_length);
  if (impl_->has_rigs) RigOfCamera(*impl_, camera.camera_id);
}

void Database::WriteImage(const Image& image) {
  CheckImageRow(*impl_, image);
  Run(*impl_,
      "INSERT INTO images(image_id, name, camera_id) VALUES(?1, ?2, ?3) "
      "ON CONFLICT(image_id) DO UPDATE SET name = ?2, camera_id = ?3;",
      image.image_id, image.name, image.camera_id);
  if (impl_->has_rigs) EnsureFrame(*impl_, image);
}

void Database::DeleteImage(image_t image_id) {
  const auto cameras = ReadRows<std::vector<camera_t>>(
      {*impl_, "SELECT camera_id FROM images WHERE image_id = ?1;", image_id},
      [](const Query& row) { return row.Int<camera_t>(0); });
  if (impl_->has_rigs) DeleteFrame(*impl_, image_id);
  // COLMAP 4.x: positions hang on no row of images, and would be those of the next with this id.
  if (ColumnExists(*impl_, "pose_priors", "corr_data_id")) {
    Run(*impl_, "DELETE FROM pose_priors WHERE corr_data_id = ?1 AND corr_sensor_type = 0;",
        image_id);
  }
  Run(*impl_, "DELETE FROM images WHERE image_id = ?1;", image_id);
  for (const camera_t camera_id : cameras) {
    Query other(*impl_, "SELECT 1 FROM images WHERE camera_id = ?1;", camera_id);
    if (!other.Step()) DeleteUnusedCamera(*impl_, camera_id);
  }
}

void Database::DeleteUnusedCameras() {
  const auto unused = ReadRows<std::vector<camera_t>>(
      {*impl_,
       "SELECT camera_id FROM cameras WHERE camera_id NOT IN (SELECT camera_id FROM images);"},
      [](const Query& row) { return row.Int<camera_t>(0); });
  for (const camera_t camera_id : unused) DeleteUnusedCamera(*impl_, camera_id);
}

void Database::DeleteFeaturesAndPairs(const std::set<image_t>& images) {
  if (images.empty()) return;
  impl_->Execute("CREATE TEMP TABLE IF NOT EXISTS removed(image_id INTEGER PRIMARY KEY);");
  for (const image_t id : images) Run(*impl_, "INSERT INTO removed VALUES(?1);", id);
  for (const std::string table :
       {"keypoints", "descriptors", "cairn_polarities", "cairn_depth_scales"}) {
    impl_->Execute(
        ("DELETE FROM " + table + " WHERE image_id IN (SELECT image_id FROM removed);").c_str());
  }
  const std::string is_removed = " IN (SELECT image_id FROM removed)";
  const auto erase_pairs = [&](const std::string& from_where, const std::string& pair) {
    impl_->Execute(("DELETE FROM " + from_where + " " + pair + " >= 0 AND (" + pair +
                    " % 2147483647" + is_removed + " OR " + pair + " / 2147483647" + is_removed +
                    ");")
                       .c_str());
  };
  for (const std::string table : {"matches", "two_view_geometries", "cairn_pair_metrics",
                                  "cairn_pair_choices", "cairn_focal_evidence"}) {
    erase_pairs(table + " WHERE", "pair_id");
  }
  for (const std::string table : {"cairn_jobs", "cairn_timings"}) {
    erase_pairs(table + " WHERE stage IN ('matching', 'verification') AND", "item");
    impl_->Execute(("DELETE FROM " + table +
                    " WHERE stage IN ('features', 'depth', 'pairs') AND item" + is_removed + ";")
                       .c_str());
  }
  impl_->Execute("DELETE FROM removed;");
}

void Database::DeleteImagesAndPairs(const std::set<image_t>& images) {
  DeleteFeaturesAndPairs(images);
  for (const image_t id : images) {
    Run(*impl_,
        "DELETE FROM cairn_photos WHERE name = (SELECT name FROM images WHERE image_id = ?1);", id);
    DeleteJob(kStageCameras, id);
    DeleteImage(id);
  }
}

Database::Transaction::Transaction(Database& database)
    : database_(sqlite3_get_autocommit(database.impl_->connection) ? &database : nullptr) {
  if (database_) database.impl_->Execute("BEGIN IMMEDIATE;");
}

Database::Transaction::~Transaction() {
  // A failed statement may already have rolled back; then there is nothing left to do.
  if (database_ && !sqlite3_get_autocommit(database_->impl_->connection)) {
    sqlite3_exec(database_->impl_->connection, "ROLLBACK;", nullptr, nullptr, nullptr);
  }
}

void Database::Transaction::Commit() {
  if (database_) database_->impl_->Execute("COMMIT;");
  database_ = nullptr;
}

}  // namespace cairn
