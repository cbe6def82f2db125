#include "cairn/database/database.h"

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "database/bad_rows.h"
#include "database/connection.h"
#include "database/sql.h"

namespace cairn {
namespace {

// COLMAP 4.x: the camera's rig, made if there is none.
int64_t RigOfCamera(Database::Impl& impl, camera_t camera_id) {
  for (int attempt = 0; attempt < 2; ++attempt) {
    for (const char* sql : {sql::kReadRig, sql::kReadRigSensor}) {
      Query query(impl, sql, camera_id);
      if (query.Step()) return query.Int(0);
    }
    if (attempt == 0) Run(impl, sql::kWriteRig, camera_id);
  }
  throw BugError("a rig was written and cannot be found");
}

struct FrameRow {
  int64_t frame_id = 0;
  int64_t sensor_id = 0;
};

std::optional<FrameRow> ReadFrame(Database::Impl& impl, image_t image_id) {
  Query query(impl, sql::kReadFrame, image_id);
  if (!query.Step()) return std::nullopt;
  return FrameRow{query.Int(0), query.Int(1)};
}

// COLMAP 4.x: takes the image out of its frame, which must hold nothing else.
void DeleteFrame(Database::Impl& impl, image_t image_id) {
  const std::optional<FrameRow> frame = ReadFrame(impl, image_id);
  if (!frame) return;
  Run(impl, sql::kDeleteFrameData, frame->frame_id);
  Run(impl, sql::kDeleteFrame, frame->frame_id);
}

// COLMAP 4.x: a frame of its own for the image, unless it has one.
void EnsureFrame(Database::Impl& impl, const Image& image) {
  const std::optional<FrameRow> frame = ReadFrame(impl, image.image_id);
  if (frame && frame->sensor_id == image.camera_id) return;
  DeleteFrame(impl, image.image_id);
  Run(impl, sql::kWriteFrame, RigOfCamera(impl, image.camera_id));
  Run(impl, sql::kWriteFrameData, image.image_id, image.camera_id);
}

void DeleteCamera(Database::Impl& impl, int64_t camera_id) {
  if (impl.has_rigs) Run(impl, sql::kDeleteRig, camera_id);
  Run(impl, sql::kDeleteCamera, camera_id);
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
    if (CameraModelFromId(static_cast<int>(query.Int(1)))) continue;
    cameras.push_back({.camera_id = static_cast<camera_t>(query.Int(0)),
                       .model_id = query.Int(1),
                       .width = static_cast<int>(query.Int(2)),
                       .height = static_cast<int>(query.Int(3))});
  }
  return cameras;
}

std::vector<Image> Database::ReadImages() const {
  std::vector<Image> images;
  Query query(*impl_, sql::kReadImages);
  while (query.Step()) {
    images.push_back({.image_id = static_cast<image_t>(query.Int(0)),
                      .name = query.Text(1),
                      .camera_id = static_cast<camera_t>(query.Int(2))});
  }
  return images;
}

void Database::WriteCamera(const Camera& camera) {
  CAIRN_CHECK(camera.camera_id != kInvalidCameraId);
  Run(*impl_, sql::kWriteCamera, camera.camera_id, static_cast<int>(camera.model), camera.width,
      camera.height, BoundBlob{camera.params.data(), camera.params.size() * sizeof(double)},
      camera.has_prior_focal_length);
  if (impl_->has_rigs) RigOfCamera(*impl_, camera.camera_id);
}

void Database::WriteImage(const Image& image) {
  CAIRN_CHECK(image.image_id != kInvalidImageId);
  CAIRN_CHECK(image.camera_id != kInvalidCameraId);
  Run(*impl_, sql::kWriteImage, image.image_id, image.name, image.camera_id);
  if (impl_->has_rigs) EnsureFrame(*impl_, image);
}

void Database::DeleteImage(image_t image_id) {
  int64_t camera_id = 0;
  {
    Query query(*impl_, sql::kReadImageCamera, image_id);
    if (!query.Step()) return;
    camera_id = query.Int(0);
  }
  if (impl_->has_rigs) DeleteFrame(*impl_, image_id);
  Run(*impl_, sql::kDeleteImage, image_id);
  const bool is_used = Query(*impl_, sql::kCameraIsUsed, camera_id).Step();
  if (!is_used) DeleteCamera(*impl_, camera_id);
}

void Database::DeleteUnusedCameras() {
  std::vector<int64_t> unused;
  {
    Query query(*impl_, sql::kReadUnusedCameras);
    while (query.Step()) unused.push_back(query.Int(0));
  }
  for (const int64_t camera_id : unused) DeleteCamera(*impl_, camera_id);
}

Database::Transaction::Transaction(Database& database) : database_(&database) {
  database.impl_->Execute(sql::kBegin);
}

Database::Transaction::~Transaction() {
  // A failed statement may already have rolled back; then there is nothing left to do.
  if (database_ && !sqlite3_get_autocommit(database_->impl_->connection)) {
    sqlite3_exec(database_->impl_->connection, sql::kRollback, nullptr, nullptr, nullptr);
  }
}

void Database::Transaction::Commit() {
  CAIRN_CHECK(database_ != nullptr);
  database_->impl_->Execute(sql::kCommit);
  database_ = nullptr;
}

}  // namespace cairn
