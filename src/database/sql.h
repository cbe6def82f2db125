#pragma once

// The tables, and which of their rows may be used. Other SQL is where its rows are read or written.
namespace cairn::sql {

// The schema of COLMAP 3.8 (user_version 3800), to the letter of its table definitions' meaning.
inline constexpr int kColmapVersion = 3800;
inline constexpr const char* kColmapSchema = R"(
CREATE TABLE IF NOT EXISTS cameras
  (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL,
   width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB,
   prior_focal_length INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS images
  (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE,
   camera_id INTEGER NOT NULL, prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL,
   prior_tx REAL, prior_ty REAL, prior_tz REAL,
   CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
   FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX IF NOT EXISTS index_name ON images(name);
CREATE TABLE IF NOT EXISTS keypoints
  (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
   FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE IF NOT EXISTS descriptors
  (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
   FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE IF NOT EXISTS matches
  (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE IF NOT EXISTS two_view_geometries
  (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
   config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
)";

// Ours. WITHOUT ROWID: the order in a dump is that of the key, not of writing. The columns
// cairn_depth_scales.scale and cairn_stages.input_hash are always 0.
inline constexpr const char* kCairnSchema = R"(
CREATE TABLE IF NOT EXISTS cairn_depth_scales
  (image_id INTEGER NOT NULL, scale INTEGER NOT NULL, hash INTEGER NOT NULL,
   rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, PRIMARY KEY(image_id, scale),
   FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_polarities
  (image_id INTEGER PRIMARY KEY NOT NULL, hash INTEGER NOT NULL, data BLOB NOT NULL,
   FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_pair_metrics
  (pair_id INTEGER NOT NULL, verifier TEXT NOT NULL, status TEXT NOT NULL,
   is_winner INTEGER NOT NULL, step TEXT NOT NULL, num_matches INTEGER NOT NULL,
   num_inliers INTEGER NOT NULL, num_iterations INTEGER NOT NULL, score REAL NOT NULL,
   residual_px REAL NOT NULL, triangulation_angle_deg REAL NOT NULL, qvec BLOB, tvec BLOB,
   PRIMARY KEY(pair_id, verifier)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_pair_choices
  (pair_id INTEGER PRIMARY KEY NOT NULL, round INTEGER NOT NULL, reason TEXT NOT NULL)
  WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_focal_evidence
  (pair_id INTEGER PRIMARY KEY NOT NULL, num_matches INTEGER NOT NULL,
   num_by_essential INTEGER NOT NULL, num_by_fundamental INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_camera_focals
  (camera_id INTEGER PRIMARY KEY NOT NULL, is_refuted INTEGER NOT NULL,
   num_pairs INTEGER NOT NULL, num_refuting INTEGER NOT NULL,
   FOREIGN KEY(camera_id) REFERENCES cameras(camera_id) ON DELETE CASCADE) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_camera_lenses
  (camera_id INTEGER PRIMARY KEY NOT NULL, focal_px REAL NOT NULL, focal_sigma REAL NOT NULL,
   is_focal_known INTEGER NOT NULL, k REAL NOT NULL, k_sigma REAL NOT NULL,
   num_pairs INTEGER NOT NULL,
   FOREIGN KEY(camera_id) REFERENCES cameras(camera_id) ON DELETE CASCADE) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_photos
  (name TEXT PRIMARY KEY NOT NULL, file_hash INTEGER NOT NULL, error TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_jobs
  (stage TEXT NOT NULL, item INTEGER NOT NULL, input_hash INTEGER NOT NULL, note TEXT NOT NULL,
   PRIMARY KEY(stage, item)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_stages
  (stage TEXT PRIMARY KEY NOT NULL, options TEXT NOT NULL, input_hash INTEGER NOT NULL,
   is_complete INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS cairn_timings
  (stage TEXT NOT NULL, item INTEGER NOT NULL, label TEXT NOT NULL, seconds REAL NOT NULL,
   PRIMARY KEY(stage, item, label)) WITHOUT ROWID;
)";

// What was learned of a camera goes when anybody changes its row. The index serves deletions.
inline constexpr const char* kCairnRules = R"(
CREATE INDEX IF NOT EXISTS cairn_images_of_cameras ON images(camera_id);
CREATE TRIGGER IF NOT EXISTS cairn_forget_learned
AFTER UPDATE OF model, width, height, params, prior_focal_length ON cameras
WHEN NEW.model IS NOT OLD.model OR NEW.width IS NOT OLD.width OR NEW.height IS NOT OLD.height
  OR NEW.params IS NOT OLD.params OR NEW.prior_focal_length IS NOT OLD.prior_focal_length
BEGIN
  DELETE FROM cairn_camera_focals WHERE camera_id = NEW.camera_id;
  DELETE FROM cairn_camera_lenses WHERE camera_id = NEW.camera_id;
END;
)";

// What may be used of tables that anybody may have written (bad_rows.cc names the rest): images
// whose names a model can hold, and pairs of two of them, the smaller id first.
inline constexpr const char* kCreateUsableImages =
    "CREATE TEMP VIEW usable_images AS SELECT image_id, name, camera_id FROM images WHERE "
    "image_id >= 0 AND image_id < 2147483647 AND camera_id >= 0 AND camera_id < 4294967295 "
    "AND length(CAST(name AS BLOB)) > 0 AND instr(CAST(name AS BLOB), x'0A') = 0 "
    "AND instr(CAST(name AS BLOB), x'0D') = 0 AND instr(CAST(name AS BLOB), x'00') = 0;";
#define CAIRN_SQL_USABLE_IMAGE "(image_id IN (SELECT image_id FROM usable_images))"
#define CAIRN_SQL_USABLE_PAIR                                         \
  "(pair_id >= 0 AND pair_id / 2147483647 < pair_id % 2147483647 "    \
  "AND pair_id / 2147483647 IN (SELECT image_id FROM usable_images) " \
  "AND pair_id % 2147483647 IN (SELECT image_id FROM usable_images))"

inline constexpr const char* kReadCameras =
    "SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras "
    "ORDER BY camera_id;";

}  // namespace cairn::sql
