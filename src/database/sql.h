#pragma once

#include <initializer_list>

// All SQL of cairn, in one place.
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

// Ours. WITHOUT ROWID: the order in a dump is that of the key, not of writing.
inline constexpr const char* kCairnSchema = R"(
CREATE TABLE IF NOT EXISTS cairn_depth_scales
  (image_id INTEGER NOT NULL, scale INTEGER NOT NULL, hash INTEGER NOT NULL,
   rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, PRIMARY KEY(image_id, scale),
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

inline constexpr const char* kTableExists =
    "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?1;";

// COLMAP's own changes of its schema: before 3.0 inlier_matches, before 3.4 no F, E, H, before 3.6
// no qvec, tvec.
inline constexpr const char* kRenameInlierMatches =
    "ALTER TABLE inlier_matches RENAME TO two_view_geometries;";

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
inline constexpr const char* kReadBadImages =
    "SELECT image_id, name, camera_id FROM images WHERE NOT " CAIRN_SQL_USABLE_IMAGE
    " ORDER BY image_id;";
inline constexpr const char* kColumnExists = "SELECT 1 FROM pragma_table_info(?1) WHERE name = ?2;";
inline constexpr const char* kAnyTableExists = "SELECT 1 FROM sqlite_master LIMIT 1;";

inline constexpr const char* kReadCameras =
    "SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras "
    "ORDER BY camera_id;";
inline constexpr const char* kWriteCamera =
    "INSERT INTO cameras(camera_id, model, width, height, params, prior_focal_length) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6) ON CONFLICT(camera_id) DO UPDATE SET model = ?2, width = ?3, "
    "height = ?4, params = ?5, prior_focal_length = ?6;";
inline constexpr const char* kReadImages =
    "SELECT image_id, name, camera_id FROM usable_images ORDER BY image_id;";
inline constexpr const char* kWriteImage =
    "INSERT INTO images(image_id, name, camera_id) VALUES(?1, ?2, ?3) "
    "ON CONFLICT(image_id) DO UPDATE SET name = ?2, camera_id = ?3;";
inline constexpr const char* kReadImageCamera = "SELECT camera_id FROM images WHERE image_id = ?1;";
inline constexpr const char* kDeleteImage = "DELETE FROM images WHERE image_id = ?1;";
inline constexpr const char* kCameraIsUsed = "SELECT 1 FROM images WHERE camera_id = ?1 LIMIT 1;";
inline constexpr const char* kReadUnusedCameras =
    "SELECT camera_id FROM cameras WHERE camera_id NOT IN (SELECT camera_id FROM images);";
inline constexpr const char* kDeleteCamera = "DELETE FROM cameras WHERE camera_id = ?1;";

// COLMAP 4.x: each camera is the reference sensor (type 0) of a rig of its own, each image a frame.
inline constexpr const char* kReadRig =
    "SELECT rig_id FROM rigs WHERE ref_sensor_id = ?1 AND ref_sensor_type = 0;";
inline constexpr const char* kReadRigSensor =
    "SELECT rig_id FROM rig_sensors WHERE sensor_id = ?1 AND sensor_type = 0;";
inline constexpr const char* kWriteRig =
    "INSERT INTO rigs(rig_id, ref_sensor_id, ref_sensor_type) "
    "VALUES((SELECT COALESCE(MAX(rig_id), 0) + 1 FROM rigs), ?1, 0);";
inline constexpr const char* kReadFrame =
    "SELECT frame_id, sensor_id FROM frame_data WHERE data_id = ?1 AND sensor_type = 0;";
inline constexpr const char* kWriteFrame =
    "INSERT INTO frames(frame_id, rig_id) "
    "VALUES((SELECT COALESCE(MAX(frame_id), 0) + 1 FROM frames), ?1);";
inline constexpr const char* kWriteFrameData =
    "INSERT INTO frame_data(frame_id, data_id, sensor_id, sensor_type) "
    "VALUES((SELECT MAX(frame_id) FROM frames), ?1, ?2, 0);";
inline constexpr const char* kDeleteFrameData = "DELETE FROM frame_data WHERE frame_id = ?1;";
inline constexpr const char* kDeleteFrame = "DELETE FROM frames WHERE frame_id = ?1;";
inline constexpr const char* kDeleteRig =
    "DELETE FROM rigs WHERE ref_sensor_id = ?1 AND ref_sensor_type = 0;";

inline constexpr const char* kReadKeypoints =
    "SELECT rows, cols, data FROM keypoints WHERE image_id = ?1;";
inline constexpr const char* kReadDescriptors =
    "SELECT rows, cols, data FROM descriptors WHERE image_id = ?1;";
inline constexpr const char* kReadDepthSamples =
    "SELECT rows, cols, data FROM cairn_depth_scales WHERE image_id = ?1 AND scale = 0;";
inline constexpr const char* kReadDepthHash =
    "SELECT hash FROM cairn_depth_scales WHERE image_id = ?1 AND scale = 0;";
inline constexpr const char* kWriteKeypoints =
    "INSERT OR REPLACE INTO keypoints(image_id, rows, cols, data) VALUES(?1, ?2, ?3, ?4);";
inline constexpr const char* kWriteDescriptors =
    "INSERT OR REPLACE INTO descriptors(image_id, rows, cols, data) VALUES(?1, ?2, ?3, ?4);";
inline constexpr const char* kWriteTypedDescriptors =  // COLMAP 4.x; type 0 is SIFT
    "INSERT OR REPLACE INTO descriptors(image_id, rows, cols, data, type) "
    "VALUES(?1, ?2, ?3, ?4, 0);";
inline constexpr const char* kWriteDepthSamples =
    "INSERT INTO cairn_depth_scales(image_id, scale, hash, rows, cols, data) "
    "VALUES(?1, 0, ?2, ?3, ?4, ?5);";
inline constexpr const char* kDeleteDepthSamples =
    "DELETE FROM cairn_depth_scales WHERE image_id = ?1;";
inline constexpr const char* kReadNumKeypoints =
    "SELECT image_id, rows FROM keypoints WHERE " CAIRN_SQL_USABLE_IMAGE ";";
inline constexpr const char* kReadNumDescriptors =
    "SELECT image_id, rows FROM descriptors WHERE " CAIRN_SQL_USABLE_IMAGE ";";
inline constexpr const char* kReadNumDepthSamples =
    "SELECT image_id, rows FROM cairn_depth_scales WHERE scale = 0 AND " CAIRN_SQL_USABLE_IMAGE ";";

inline constexpr const char* kReadNumMatches =
    "SELECT pair_id, rows FROM matches WHERE " CAIRN_SQL_USABLE_PAIR " ORDER BY pair_id;";
inline constexpr const char* kReadMatches =
    "SELECT rows, cols, data FROM matches WHERE pair_id = ?1;";
inline constexpr const char* kWriteMatches =
    "INSERT OR REPLACE INTO matches(pair_id, rows, cols, data) VALUES(?1, ?2, ?3, ?4);";
inline constexpr const char* kReadNumInliers =
    "SELECT pair_id, rows FROM two_view_geometries WHERE " CAIRN_SQL_USABLE_PAIR
    " ORDER BY pair_id;";
inline constexpr const char* kReadTwoViewGeometry =
    "SELECT rows, cols, data, config, F, E, H, qvec, tvec FROM two_view_geometries "
    "WHERE pair_id = ?1;";
inline constexpr const char* kWriteTwoViewGeometry =
    "INSERT OR REPLACE INTO two_view_geometries(pair_id, rows, cols, data, config, F, E, H, qvec, "
    "tvec) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10);";

inline constexpr const char* kReadPairChoices =
    "SELECT pair_id, round, reason FROM cairn_pair_choices ORDER BY pair_id;";
inline constexpr const char* kWritePairChoice =
    "INSERT OR IGNORE INTO cairn_pair_choices(pair_id, round, reason) VALUES(?1, ?2, ?3);";

inline constexpr const char* kReadAllPairMetrics =
    "SELECT pair_id, verifier, status, is_winner, step, num_matches, num_inliers, num_iterations, "
    "score, residual_px, triangulation_angle_deg, qvec, tvec FROM cairn_pair_metrics "
    "WHERE " CAIRN_SQL_USABLE_PAIR " ORDER BY pair_id, verifier;";
inline constexpr const char* kReadPairMetrics =
    "SELECT pair_id, verifier, status, is_winner, step, num_matches, num_inliers, num_iterations, "
    "score, residual_px, triangulation_angle_deg, qvec, tvec FROM cairn_pair_metrics "
    "WHERE pair_id = ?1 ORDER BY verifier;";
inline constexpr const char* kWritePairMetrics =
    "INSERT OR REPLACE INTO cairn_pair_metrics(pair_id, verifier, status, is_winner, step, "
    "num_matches, num_inliers, num_iterations, score, residual_px, triangulation_angle_deg, qvec, "
    "tvec) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13);";

inline constexpr const char* kCountWinners =
    "SELECT verifier, COUNT(*) FROM cairn_pair_metrics WHERE is_winner GROUP BY verifier;";

inline constexpr const char* kReadStepTimes =
    "SELECT m.step, COUNT(*), TOTAL(t.seconds) FROM cairn_pair_metrics AS m LEFT JOIN "
    "cairn_timings AS t ON t.stage = 'verification' AND t.item = m.pair_id AND t.label = "
    "m.verifier WHERE m.step <> '' GROUP BY m.step ORDER BY COUNT(*) DESC, m.step;";

inline constexpr const char* kWriteTiming =
    "INSERT OR REPLACE INTO cairn_timings(stage, item, label, seconds) VALUES(?1, ?2, ?3, ?4);";
inline constexpr const char* kAddTiming =
    "INSERT INTO cairn_timings(stage, item, label, seconds) VALUES(?1, ?2, ?3, ?4) "
    "ON CONFLICT(stage, item, label) DO UPDATE SET seconds = seconds + ?4;";
inline constexpr const char* kReadTiming =
    "SELECT seconds FROM cairn_timings WHERE stage = ?1 AND item = ?2 AND label = ?3;";

inline constexpr const char* kReadPhotos =
    "SELECT name, file_hash, error FROM cairn_photos ORDER BY name;";
inline constexpr const char* kWritePhoto =
    "INSERT OR REPLACE INTO cairn_photos(name, file_hash, error) VALUES(?1, ?2, ?3);";
inline constexpr const char* kReadJobs =
    "SELECT item, input_hash, note FROM cairn_jobs WHERE stage = ?1 ORDER BY item;";
inline constexpr const char* kReadJob =
    "SELECT item, input_hash, note FROM cairn_jobs WHERE stage = ?1 AND item = ?2;";
inline constexpr const char* kWriteJob =
    "INSERT OR REPLACE INTO cairn_jobs(stage, item, input_hash, note) VALUES(?1, ?2, ?3, ?4);";
inline constexpr const char* kCountJobNotes =
    "SELECT note, COUNT(*) FROM cairn_jobs WHERE stage = ?1 GROUP BY note;";
inline constexpr const char* kReadStage =
    "SELECT stage, options, input_hash, is_complete FROM cairn_stages WHERE stage = ?1;";
inline constexpr const char* kWriteStage =
    "INSERT OR REPLACE INTO cairn_stages(stage, options, input_hash, is_complete) "
    "VALUES(?1, ?2, ?3, ?4);";

inline constexpr const char* kReadFocalEvidence =
    "SELECT pair_id, num_matches, num_by_essential, num_by_fundamental FROM cairn_focal_evidence "
    "WHERE " CAIRN_SQL_USABLE_PAIR " ORDER BY pair_id;";
inline constexpr const char* kWriteFocalEvidence =
    "INSERT OR REPLACE INTO cairn_focal_evidence(pair_id, num_matches, num_by_essential, "
    "num_by_fundamental) VALUES(?1, ?2, ?3, ?4);";
inline constexpr const char* kReadCameraFocals =
    "SELECT camera_id, is_refuted, num_pairs, num_refuting FROM cairn_camera_focals "
    "ORDER BY camera_id;";
inline constexpr const char* kClearCameraFocals = "DELETE FROM cairn_camera_focals;";
inline constexpr const char* kWriteCameraFocal =
    "INSERT OR REPLACE INTO cairn_camera_focals(camera_id, is_refuted, num_pairs, num_refuting) "
    "VALUES(?1, ?2, ?3, ?4);";
inline constexpr const char* kReadCameraLenses =
    "SELECT camera_id, focal_px, focal_sigma, is_focal_known, k, k_sigma, num_pairs "
    "FROM cairn_camera_lenses ORDER BY camera_id;";
inline constexpr const char* kWriteCameraLens =
    "INSERT OR REPLACE INTO cairn_camera_lenses(camera_id, focal_px, focal_sigma, is_focal_known, "
    "k, k_sigma, num_pairs) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7);";
inline constexpr const char* kDeleteTwoViewGeometry =
    "DELETE FROM two_view_geometries WHERE pair_id = ?1;";
inline constexpr const char* kDeletePairMetrics =
    "DELETE FROM cairn_pair_metrics WHERE pair_id = ?1;";
inline constexpr const char* kDeleteFocalEvidence =
    "DELETE FROM cairn_focal_evidence WHERE pair_id = ?1;";
inline constexpr const char* kDeleteJob = "DELETE FROM cairn_jobs WHERE stage = ?1 AND item = ?2;";
// Tables of pairs, or (jobs but those of cameras, and times but those of whole stages) of images
// and pairs: which there are, and how to delete the rows of one.
struct TableOfItems {
  const char* read;
  const char* erase;
};
inline constexpr TableOfItems kTablesOfItems[] = {
    {"SELECT pair_id FROM matches;", "DELETE FROM matches WHERE pair_id = ?1;"},
    {"SELECT pair_id FROM two_view_geometries;", kDeleteTwoViewGeometry},
    {"SELECT DISTINCT pair_id FROM cairn_pair_metrics;", kDeletePairMetrics},
    {"SELECT pair_id FROM cairn_pair_choices;",
     "DELETE FROM cairn_pair_choices WHERE pair_id = ?1;"},
    {"SELECT pair_id FROM cairn_focal_evidence;", kDeleteFocalEvidence},
    {"SELECT DISTINCT item FROM cairn_jobs WHERE stage <> 'cameras';",
     "DELETE FROM cairn_jobs WHERE item = ?1 AND stage <> 'cameras';"},
    {"SELECT DISTINCT item FROM cairn_timings WHERE item > 0;",
     "DELETE FROM cairn_timings WHERE item = ?1;"}};
inline constexpr const char* kDeleteKeypoints = "DELETE FROM keypoints WHERE image_id = ?1;";
inline constexpr const char* kDeleteDescriptors = "DELETE FROM descriptors WHERE image_id = ?1;";
inline constexpr const char* kReadImageName = "SELECT name FROM images WHERE image_id = ?1;";
inline constexpr const char* kDeletePhoto = "DELETE FROM cairn_photos WHERE name = ?1;";
inline constexpr const char* kClearJobs = "DELETE FROM cairn_jobs WHERE stage = ?1;";
inline constexpr const char* kClearTimings = "DELETE FROM cairn_timings WHERE stage = ?1;";
inline constexpr const char* kClearStage = "DELETE FROM cairn_stages WHERE stage = ?1;";

// What a stage wrote, whichever program did.
inline constexpr const char* kClearPhotos = "DELETE FROM cairn_photos;";
inline constexpr const char* kClearFeatures = "DELETE FROM keypoints; DELETE FROM descriptors;";
inline constexpr const char* kClearDepth = "DELETE FROM cairn_depth_scales;";
inline constexpr const char* kClearPairChoices = "DELETE FROM cairn_pair_choices;";
inline constexpr const char* kClearMatches = "DELETE FROM matches;";
inline constexpr const char* kClearVerification =
    "DELETE FROM two_view_geometries; DELETE FROM cairn_pair_metrics; "
    "DELETE FROM cairn_focal_evidence; DELETE FROM cairn_camera_focals; "
    "DELETE FROM cairn_camera_lenses;";

inline constexpr const char* kBegin = "BEGIN IMMEDIATE;";
inline constexpr const char* kBeginReading = "BEGIN;";
inline constexpr const char* kCommit = "COMMIT;";
inline constexpr const char* kRollback = "ROLLBACK;";

}  // namespace cairn::sql
