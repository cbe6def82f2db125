#include <sstream>

#include "cairn/database/database.h"
#include "database/match_origins.h"
#include "database/query.h"
#include "database/stage_names.h"

namespace cairn {

void Database::WriteTiming(const std::string& stage, uint64_t item, const std::string& label,
                           double seconds) {
  Run(*impl_,
      "INSERT OR REPLACE INTO cairn_timings(stage, item, label, seconds) VALUES(?1, ?2, ?3, ?4);",
      stage, item, label, seconds);
}

void Database::AddStageTime(const std::string& stage, double seconds) {
  Run(*impl_,
      "INSERT INTO cairn_timings(stage, item, label, seconds) VALUES(?1, 0, '', ?2) "
      "ON CONFLICT(stage, item, label) DO UPDATE SET seconds = seconds + ?2;",
      stage, seconds);
}

std::optional<double> Database::ReadTiming(const std::string& stage, uint64_t item,
                                           const std::string& label) const {
  Query query(*impl_,
              "SELECT seconds FROM cairn_timings WHERE stage = ?1 AND item = ?2 AND label = ?3;",
              stage, item, label);
  if (!query.Step()) return std::nullopt;
  return query.Double(0);
}

std::vector<PhotoRecord> Database::ReadPhotos() const {
  return ReadRows<std::vector<PhotoRecord>>(
      {*impl_, "SELECT name, file_hash, error FROM cairn_photos ORDER BY name;"},
      [](const Query& row) {
        return PhotoRecord{row.Text(0), row.Int<uint64_t>(1), row.Text(2)};
      });
}

void Database::WritePhoto(const PhotoRecord& photo) {
  Run(*impl_, "INSERT OR REPLACE INTO cairn_photos(name, file_hash, error) VALUES(?1, ?2, ?3);",
      photo.name, photo.file_hash, photo.error);
}

void Database::ClearPhotos() { impl_->Execute("DELETE FROM cairn_photos;"); }

std::vector<JobRecord> Database::ReadJobs(const std::string& stage) const {
  return ReadRows<std::vector<JobRecord>>(
      {*impl_, "SELECT item, input_hash, note FROM cairn_jobs WHERE stage = ?1 ORDER BY item;",
       stage},
      [](const Query& row) {
        return JobRecord{row.Int<uint64_t>(0), row.Int<uint64_t>(1), row.Text(2)};
      });
}

void Database::WriteJob(const std::string& stage, const JobRecord& job) {
  Run(*impl_,
      "INSERT OR REPLACE INTO cairn_jobs(stage, item, input_hash, note) VALUES(?1, ?2, ?3, ?4);",
      stage, job.item, job.input_hash, job.note);
}

void Database::DeleteJob(const std::string& stage, uint64_t item) {
  Run(*impl_, "DELETE FROM cairn_jobs WHERE stage = ?1 AND item = ?2;", stage, item);
}

std::map<std::string, std::string> StageRecord::OptionValues() const {
  std::map<std::string, std::string> values;
  std::istringstream lines(options);
  for (std::string line; std::getline(lines, line);) {
    const size_t equals = line.find(" = ");
    if (equals != std::string::npos) values[line.substr(0, equals)] = line.substr(equals + 3);
  }
  return values;
}

std::optional<StageRecord> Database::ReadStage(const std::string& stage) const {
  Query query(*impl_, "SELECT stage, options, is_complete FROM cairn_stages WHERE stage = ?1;",
              stage);
  if (!query.Step()) return std::nullopt;
  return StageRecord{query.Text(0), query.Text(1), query.Int<bool>(2)};
}

void Database::WriteStage(const StageRecord& record) {
  Run(*impl_,
      "INSERT OR REPLACE INTO cairn_stages(stage, options, input_hash, is_complete) "
      "VALUES(?1, ?2, 0, ?3);",
      record.stage, record.options, record.is_complete);
}

Database::LostRows Database::ForgetLostRows(bool has_photographs) {
  // Items of jobs are images, or pairs, whose ids are larger.
  const auto images = ReadRows<std::vector<image_t>>(
      {*impl_,
       "SELECT DISTINCT item FROM cairn_jobs WHERE ?1 AND item BETWEEN 1 AND 2147483646 "
       "AND item NOT IN (SELECT image_id FROM images);",
       has_photographs},
      [](const Query& row) { return row.Int<image_t>(0); });
  Transaction transaction(*this);
  DeleteFeaturesAndPairs({images.begin(), images.end()});
  for (const image_t id : images) DeleteJob(kStageCameras, id);
  const auto pairs = ReadRows<std::vector<int64_t>>(
      {*impl_,
       "SELECT COUNT(*) FROM cairn_jobs WHERE stage = 'verification' "
       "AND item NOT IN (SELECT pair_id FROM two_view_geometries);"},
      [](const Query& row) { return row.Int(0); });
  impl_->Execute(
      "DELETE FROM cairn_photos WHERE error = '' AND name NOT IN (SELECT name FROM images);"
      "DELETE FROM cairn_jobs WHERE stage = 'features' "
      "AND item NOT IN (SELECT image_id FROM keypoints);"
      "DELETE FROM cairn_jobs WHERE stage = 'depth' AND note = '' "
      "AND item NOT IN (SELECT image_id FROM cairn_depth_scales);"
      "DELETE FROM cairn_jobs WHERE stage = 'dataset' AND NOT EXISTS (SELECT 1 FROM images);");
  // Where no matches are left, other programs' choices of pairs are gone with them.
  Run(*impl_,
      "DELETE FROM cairn_jobs WHERE (stage = 'pairs' OR (stage = 'matching' AND note = ?1)) "
      "AND NOT EXISTS (SELECT 1 FROM matches);",
      kGivenNote);
  if (pairs.front() > 0) {
    impl_->Execute(
        "DELETE FROM cairn_pair_metrics WHERE pair_id NOT IN "
        "(SELECT pair_id FROM two_view_geometries);"
        "DELETE FROM cairn_focal_evidence WHERE pair_id NOT IN "
        "(SELECT pair_id FROM two_view_geometries);"
        "DELETE FROM cairn_timings WHERE stage = 'verification' AND item > 0 "
        "AND item NOT IN (SELECT pair_id FROM two_view_geometries);"
        "DELETE FROM cairn_jobs WHERE stage = 'verification' "
        "AND item NOT IN (SELECT pair_id FROM two_view_geometries);"
        // What was learned from pairs, where none is left.
        "DELETE FROM cairn_camera_focals WHERE NOT EXISTS (SELECT 1 FROM two_view_geometries);"
        "DELETE FROM cairn_camera_lenses WHERE NOT EXISTS (SELECT 1 FROM two_view_geometries);");
  }
  transaction.Commit();
  return {std::ssize(images), pairs.front()};
}

void Database::ClearStage(const std::string& stage) {
  const std::map<std::string, const char*> erase_results = {
      {kStageFeatures,
       "DELETE FROM keypoints; DELETE FROM descriptors; DELETE FROM cairn_polarities;"},
      {kStageDepth, "DELETE FROM cairn_depth_scales;"},
      {kStagePairs, "DELETE FROM cairn_pair_choices;"},
      {kStageMatching, "DELETE FROM matches;"},
      {kStageVerification,
       "DELETE FROM two_view_geometries; DELETE FROM cairn_pair_metrics; "
       "DELETE FROM cairn_focal_evidence; DELETE FROM cairn_camera_focals; "
       "DELETE FROM cairn_camera_lenses;"}};
  const auto results = erase_results.find(stage);
  if (results != erase_results.end()) impl_->Execute(results->second);
  Run(*impl_, "DELETE FROM cairn_jobs WHERE stage = ?1;", stage);
  Run(*impl_, "DELETE FROM cairn_timings WHERE stage = ?1;", stage);
  Run(*impl_, "DELETE FROM cairn_stages WHERE stage = ?1;", stage);
}

}  // namespace cairn
