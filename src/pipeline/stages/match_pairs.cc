#include <algorithm>
#include <atomic>
#include <map>
#include <set>

#include "base/hash.h"
#include "base/memory.h"
#include "cairn/base/error.h"
#include "cairn/pipeline/stages.h"
#include "database/database_writer.h"
#include "database/match_origins.h"
#include "database/stage_names.h"
#include "pipeline/machines/helpers.h"
#include "pipeline/pairs/feed.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

// What the stage finds in the database and has to add to it.
struct MatchingWork {
  std::map<image_t, int> num_descriptors;
  size_t num_present = 0;  // pairs that are matched already
  std::vector<image_pair_t> pairs;
  std::vector<JobRecord> new_jobs;  // images that take part for the first time
  int num_left_out = 0;             // images without descriptors and without matches
  int64_t max_bytes = 0;            // of a tile
};

// Without polarities that of the descriptors alone, as in databases that have none.
uint64_t HashOf(const Descriptors& descriptors, const Polarities& polarities) {
  return Hasher()
      .AddBytes(descriptors.data(), static_cast<size_t>(descriptors.size()))
      .AddBytes(polarities.data(), polarities.size())
      .Digest();
}

// Hashes of the descriptors of these images, as far as they have any. Images whose row cannot be
// read are reported and left out.
std::map<image_t, uint64_t> HashDescriptorsOf(const std::set<image_t>& images,
                                              const std::map<image_t, std::string>& names,
                                              const Database& database, Stage& stage) {
  std::map<image_t, uint64_t> hashes;
  std::vector<std::string> not_matched, reasons;
  for (const image_t id : images) {
    try {
      if (const auto descriptors = database.ReadDescriptors(id)) {
        hashes[id] = HashOf(*descriptors, database.ReadPolarities(id, *descriptors));
      }
    } catch (const IoError& error) {
      not_matched.push_back(std::string(error.what()) + "; " +
                            (names.contains(id) ? names.at(id) : "image " + std::to_string(id)) +
                            " is not matched");
      reasons.push_back(error.reason());
    }
  }
  stage.WarnEach(not_matched);
  if (!reasons.empty()) {
    const std::string photos = reasons.size() == 1 ? " photograph is" : " photographs are";
    stage.Warn(ResultWarning{
        std::to_string(reasons.size()) + photos + " not matched; for example, " + reasons.front(),
        "write these descriptors again"});
  }
  return hashes;
}

MatchingWork FindWork(const Database& database, std::vector<image_pair_t> wanted,
                      const StageLedger& ledger, Stage& stage) {
  MatchingWork work;
  work.num_descriptors = database.ReadNumDescriptors();
  std::vector<image_pair_t> present;
  for (const auto& [pair, num] : database.ReadNumMatches()) present.push_back(pair);
  work.num_present = present.size();
  std::set<image_t> matched = ImagesOf(present);
  matched.merge(ImagesOf(database.ReadTwoViewGeometryPairIds()));
  int num_closed = 0;
  std::map<image_t, std::string> names;
  for (const Image& image : database.ReadImages()) {
    const image_t id = image.image_id;
    names[id] = image.name;
    if (work.num_descriptors.contains(id)) continue;
    ++(matched.contains(id) ? num_closed : work.num_left_out);
  }
  if (num_closed > 0 && !work.num_descriptors.empty()) {
    stage.Warn(ResultWarning{std::to_string(num_closed) +
                                 " images have matches, but no descriptors: others cannot be "
                                 "matched with them",
                             "write their descriptors, or begin with a new database"});
  }
  const MatchOrigins origins(database);
  const std::set<image_t>& unrecorded = origins.unrecorded();
  std::set<image_t> images = ImagesOf(wanted);
  images.insert(unrecorded.begin(), unrecorded.end());
  const std::map<image_t, uint64_t> hashes = HashDescriptorsOf(images, names, database, stage);
  std::erase_if(wanted, [&](image_pair_t pair) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    return !hashes.contains(id1) || !hashes.contains(id2);
  });
  std::set_difference(wanted.begin(), wanted.end(), present.begin(), present.end(),
                      std::back_inserter(work.pairs));
  // Records are written for given images too, but only where the stage has something to do.
  std::set<image_t> taking_part = ImagesOf(work.pairs);
  if (!work.pairs.empty()) taking_part.insert(unrecorded.begin(), unrecorded.end());
  for (const auto& [id, hash] : hashes) {
    if (ledger.Find(id) == nullptr && !taking_part.contains(id)) continue;
    if (ledger.IsDone(id, hash, "the features of " + names[id])) continue;
    work.new_jobs.push_back({id, hash, unrecorded.contains(id) ? kGivenNote : ""});
  }
  return work;
}

void BeginStage(Database& database, const MatchingWork& work, StageLedger& ledger) {
  Database::Transaction transaction(database);
  ledger.Begin(database);
  for (const JobRecord& job : work.new_jobs) database.WriteJob(kStageMatching, job);
  transaction.Commit();
}

// Matches all pairs of the work; returns the number of matches found.
int64_t MatchAll(const std::string& database_path, const MatchingWork& work,
                 const MatchingOptions& options, const RunContext& run, Helpers* helpers) {
  std::map<image_t, int64_t> image_bytes;
  for (const auto& [id, num] : work.num_descriptors)
    image_bytes[id] = int64_t{num} * kDescriptorSize;
  Database reader(database_path, Database::Mode::kReadOnly);
  DatabaseWriter writer(database_path);
  PairFeed feed(
      PlanPairTiles(work.pairs, image_bytes, work.max_bytes),
      [&reader](image_t id) {
        PairImage image;
        image.descriptors = *reader.ReadDescriptors(id);
        image.polarities = reader.ReadPolarities(id, image.descriptors);
        return image;
      },
      [](PairTask& task, const auto& image) {
        const auto [id1, id2] = PairIdToImagePair(task.pair_id);
        task.image1 = image(id1);
        task.image2 = image(id2);
        return true;
      },
      work.max_bytes / 8);
  std::atomic<int64_t> num_matches = 0;
  run.monitor.BeginStage("matching", static_cast<int64_t>(work.pairs.size()));
  const auto keep = [&](MatchResult result, const std::string&) {
    num_matches += std::ssize(result.matches);
    writer.Push([result = std::move(result)](Database& db) {
      db.WriteMatches(result.pair_id, result.matches);
    });
    run.monitor.Advance(1);
  };
  const auto match = [&](int, const PairTask& task) { return MatchTask(task, options); };
  ForEachTask<MatchResult>(TaskKind::kMatch, feed, helpers, run, match, keep);
  writer.Finish();
  run.monitor.EndStage();
  return num_matches;
}

}  // namespace

StageReport MatchImagePairs(Database& database, const PairsToMatch& wanted,
                            const MatchingOptions& options, const RunContext& run,
                            Helpers* helpers) {
  Stage stage(run.monitor, kStageMatching);
  StageLedger ledger(database, kStageMatching, DumpQualified("matching", options));
  MatchingWork work = FindWork(database, wanted.pairs, ledger, stage);
  // Half for the present tile; tasks that still hold images of the last one have the rest.
  work.max_bytes = GibToBytes(wanted.scheduler.max_memory_gib) / 2;
  int64_t num_matches = 0;
  if (!work.pairs.empty()) {
    BeginStage(database, work, ledger);
    num_matches = MatchAll(database.path(), work, options, run, helpers);
  }
  if (work.num_left_out > 0) {
    stage.Warn("images without descriptors (in no pair): " + std::to_string(work.num_left_out));
  }
  const size_t num_pairs = database.ReadNumMatches().size();
  stage.Add("pairs", num_pairs);
  stage.Add("computed", num_pairs - work.num_present);
  stage.Add("new_matches", num_matches);
  return EndStage(stage, run, ledger, database);
}

}  // namespace cairn
