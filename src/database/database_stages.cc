#include <sstream>

#include "cairn/database/database.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {
namespace {

JobRecord JobFromRow(const Query& query) {
  return {static_cast<uint64_t>(query.Int(0)), static_cast<uint64_t>(query.Int(1)), query.Text(2)};
}

}  // namespace

void Database::WriteTiming(const std::string& stage, uint64_t item, const std::string& label,
                           double seconds) {
  Run(*impl_, sql::kWriteTiming, stage, item, label, seconds);
}

void Database::AddTiming(const std::string& stage, uint64_t item, const std::string& label,
                         double seconds) {
  Run(*impl_, sql::kAddTiming, stage, item, label, seconds);
}

std::optional<double> Database::ReadTiming(const std::string& stage, uint64_t item,
                                           const std::string& label) const {
  Query query(*impl_, sql::kReadTiming, stage, item, label);
  if (!query.Step()) return std::nullopt;
  return query.Double(0);
}

std::vector<PhotoRecord> Database::ReadPhotos() const {
  std::vector<PhotoRecord> photos;
  Query query(*impl_, sql::kReadPhotos);
  while (query.Step()) {
    photos.push_back({query.Text(0), static_cast<uint64_t>(query.Int(1)), query.Text(2)});
  }
  return photos;
}

void Database::WritePhoto(const PhotoRecord& photo) {
  Run(*impl_, sql::kWritePhoto, photo.name, photo.file_hash, photo.error);
}

void Database::ClearPhotos() { impl_->Execute(sql::kClearPhotos); }

std::vector<JobRecord> Database::ReadJobs(const std::string& stage) const {
  std::vector<JobRecord> jobs;
  Query query(*impl_, sql::kReadJobs, stage);
  while (query.Step()) jobs.push_back(JobFromRow(query));
  return jobs;
}

std::optional<JobRecord> Database::ReadJob(const std::string& stage, uint64_t item) const {
  Query query(*impl_, sql::kReadJob, stage, item);
  if (!query.Step()) return std::nullopt;
  return JobFromRow(query);
}

void Database::WriteJob(const std::string& stage, const JobRecord& job) {
  Run(*impl_, sql::kWriteJob, stage, job.item, job.input_hash, job.note);
}

void Database::DeleteJob(const std::string& stage, uint64_t item) {
  Run(*impl_, sql::kDeleteJob, stage, item);
}

std::map<std::string, int64_t> Database::CountJobNotes(const std::string& stage) const {
  std::map<std::string, int64_t> counts;
  Query query(*impl_, sql::kCountJobNotes, stage);
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
  Query query(*impl_, sql::kReadStage, stage);
  if (!query.Step()) return std::nullopt;
  return StageRecord{query.Text(0), query.Text(1), static_cast<uint64_t>(query.Int(2)),
                     query.Int(3) != 0};
}

void Database::WriteStage(const StageRecord& record) {
  Run(*impl_, sql::kWriteStage, record.stage, record.options, record.input_hash,
      record.is_complete);
}

void Database::ClearFeatures() { impl_->Execute(sql::kClearFeatures); }

void Database::ClearDepth() { impl_->Execute(sql::kClearDepth); }

void Database::ClearPairChoices() { impl_->Execute(sql::kClearPairChoices); }

void Database::ClearMatches() { impl_->Execute(sql::kClearMatches); }

void Database::ClearVerification() { impl_->Execute(sql::kClearVerification); }

void Database::ClearStage(const std::string& stage) {
  for (const char* sql : {sql::kClearJobs, sql::kClearTimings, sql::kClearStage}) {
    Run(*impl_, sql, stage);
  }
}

}  // namespace cairn
