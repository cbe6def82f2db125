#include <sstream>

#include "cairn/database/database.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {
namespace {

void BindTiming(Query& query, const std::string& stage, uint64_t item, const std::string& label) {
  query.Bind(1, std::string_view(stage)).Bind(2, item).Bind(3, std::string_view(label));
}

JobRecord JobFromRow(const Query& query) {
  return {static_cast<uint64_t>(query.Int(0)), static_cast<uint64_t>(query.Int(1)), query.Text(2)};
}

}  // namespace

void Database::WriteTiming(const std::string& stage, uint64_t item, const std::string& label,
                           double seconds) {
  Query query(*impl_, sql::kWriteTiming);
  BindTiming(query, stage, item, label);
  query.Bind(4, seconds).Run();
}

void Database::AddTiming(const std::string& stage, uint64_t item, const std::string& label,
                         double seconds) {
  Query query(*impl_, sql::kAddTiming);
  BindTiming(query, stage, item, label);
  query.Bind(4, seconds).Run();
}

std::optional<double> Database::ReadTiming(const std::string& stage, uint64_t item,
                                           const std::string& label) const {
  if (!impl_->has_cairn_tables) return std::nullopt;
  Query query(*impl_, sql::kReadTiming);
  BindTiming(query, stage, item, label);
  if (!query.Step()) return std::nullopt;
  return query.Double(0);
}

std::vector<PhotoRecord> Database::ReadPhotos() const {
  std::vector<PhotoRecord> photos;
  if (!impl_->has_cairn_tables) return photos;
  Query query(*impl_, sql::kReadPhotos);
  while (query.Step()) {
    photos.push_back({query.Text(0), static_cast<uint64_t>(query.Int(1)), query.Text(2)});
  }
  return photos;
}

void Database::WritePhoto(const PhotoRecord& photo) {
  Query(*impl_, sql::kWritePhoto)
      .Bind(1, std::string_view(photo.name))
      .Bind(2, photo.file_hash)
      .Bind(3, std::string_view(photo.error))
      .Run();
}

void Database::ClearPhotos() { Query(*impl_, sql::kClearPhotos).Run(); }

std::vector<JobRecord> Database::ReadJobs(const std::string& stage) const {
  std::vector<JobRecord> jobs;
  if (!impl_->has_cairn_tables) return jobs;
  Query query(*impl_, sql::kReadJobs);
  query.Bind(1, std::string_view(stage));
  while (query.Step()) jobs.push_back(JobFromRow(query));
  return jobs;
}

std::optional<JobRecord> Database::ReadJob(const std::string& stage, uint64_t item) const {
  if (!impl_->has_cairn_tables) return std::nullopt;
  Query query(*impl_, sql::kReadJob);
  if (!query.Bind(1, std::string_view(stage)).Bind(2, item).Step()) return std::nullopt;
  return JobFromRow(query);
}

void Database::WriteJob(const std::string& stage, const JobRecord& job) {
  Query(*impl_, sql::kWriteJob)
      .Bind(1, std::string_view(stage))
      .Bind(2, job.item)
      .Bind(3, job.input_hash)
      .Bind(4, std::string_view(job.note))
      .Run();
}

void Database::DeleteJob(const std::string& stage, uint64_t item) {
  Query(*impl_, sql::kDeleteJob).Bind(1, std::string_view(stage)).Bind(2, item).Run();
}

std::map<std::string, int64_t> Database::CountJobNotes(const std::string& stage) const {
  std::map<std::string, int64_t> counts;
  if (!impl_->has_cairn_tables) return counts;
  Query query(*impl_, sql::kCountJobNotes);
  query.Bind(1, std::string_view(stage));
  while (query.Step()) counts[query.Text(0)] = query.Int(1);
  return counts;
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
  if (!impl_->has_cairn_tables) return std::nullopt;
  Query query(*impl_, sql::kReadStage);
  if (!query.Bind(1, std::string_view(stage)).Step()) return std::nullopt;
  return StageRecord{query.Text(0), query.Text(1), static_cast<uint64_t>(query.Int(2)),
                     query.Int(3) != 0};
}

void Database::WriteStage(const StageRecord& record) {
  Query(*impl_, sql::kWriteStage)
      .Bind(1, std::string_view(record.stage))
      .Bind(2, std::string_view(record.options))
      .Bind(3, record.input_hash)
      .Bind(4, static_cast<int>(record.is_complete))
      .Run();
}

void Database::ClearFeatures() {
  Query(*impl_, sql::kClearKeypoints).Run();
  Query(*impl_, sql::kClearDescriptors).Run();
}

void Database::ClearDepth() { Query(*impl_, sql::kClearDepthSamples).Run(); }

void Database::ClearPairChoices() { Query(*impl_, sql::kClearPairChoices).Run(); }

void Database::ClearMatches() { Query(*impl_, sql::kClearMatches).Run(); }

void Database::ClearVerification() {
  Query(*impl_, sql::kClearTwoViewGeometries).Run();
  Query(*impl_, sql::kClearPairMetrics).Run();
  Query(*impl_, sql::kClearFocalEvidence).Run();
  Query(*impl_, sql::kClearCameraFocals).Run();
  Query(*impl_, sql::kClearCameraLenses).Run();
}

void Database::ClearStage(const std::string& stage) {
  for (const char* sql : {sql::kClearJobs, sql::kClearTimings, sql::kClearStage}) {
    Query(*impl_, sql).Bind(1, std::string_view(stage)).Run();
  }
}

}  // namespace cairn
