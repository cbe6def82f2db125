#include "pipeline/pairs/choose.h"

#include <algorithm>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/base/timer.h"
#include "database/stage_names.h"
#include "pipeline/pairs/candidates.h"
#include "pipeline/pairs/exhaustive.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

// `auto` matches all pairs up to so much work: a minute of two cores. It is counted, not measured,
// so that every machine chooses alike.
constexpr double kMaxExhaustiveSeconds = 120.0;
// Of a sequence, `auto` takes what retrieval may miss; the rounds find the rest.
constexpr int kAutoOverlap = 2;
// Candidates whose largest features are matched, for each neighbor that is chosen.
constexpr int kCandidatesPerNeighbor = 6;
// From there on, more of a way's work is used than wasted.
constexpr double kHalf = 0.5;
// A round of fewer pairs two edges apart, of those chosen since photographs joined, is not worth
// its start.
constexpr double kMinGrowth = 0.01;
// An image with so many times the verified pairs that retrieval proposes needs no more of the kind.
constexpr int kEnough = 8;

std::string CountOf(size_t num, size_t all) {
  return std::to_string(num) + " of " + std::to_string(all) + " photographs";
}

bool Contains(const std::vector<PairWay>& ways, PairWay way) {
  return std::find(ways.begin(), ways.end(), way) != ways.end();
}

bool NeedsTimes(const std::vector<PairWay>& ways, const PairSelectionOptions& options) {
  return Contains(ways, PairWay::kSequential) && options.order == PhotoOrder::kTime;
}

// What the user's ways cannot do without.
void CheckFacts(const PhotoFacts& facts, size_t num_images, const std::vector<PairWay>& ways,
                const PairSelectionOptions& options) {
  if (NeedsTimes(ways, options) && facts.taken_at_s.size() < 2) {
    throw ConfigError("pair_selection.order",
                      "is time, but " + CountOf(facts.taken_at_s.size(), num_images) +
                          " have one in their EXIF; order by name, or choose otherwise");
  }
  if (Contains(ways, PairWay::kSpatial) && facts.positions.size() < 2) {
    throw ConfigError("pairs", "spatial needs to know where photographs were taken, but " +
                                   CountOf(facts.positions.size(), num_images) +
                                   " have GPS (in EXIF below image_path, or in gps_path)");
  }
}

// Share of the neighbors in the sequences that are among the first candidates of each other: near 1
// for a walk with a camera, near 0 where the order means nothing.
double ShareOfAlikeNeighbors(const std::vector<std::vector<image_t>>& sequences,
                             const std::vector<image_pair_t>& alike) {
  const std::vector<image_pair_t> neighbors = SequentialPairs(sequences, 1, false);
  const auto num = std::count_if(neighbors.begin(), neighbors.end(), [&](image_pair_t pair) {
    return std::binary_search(alike.begin(), alike.end(), pair);
  });
  return neighbors.empty() ? 0.0 : static_cast<double>(num) / static_cast<double>(neighbors.size());
}

PairEvidence ReadEvidence(const Database& database, const std::map<image_t, int>& num_descriptors) {
  PairEvidence evidence;
  for (const auto& [id, num] : num_descriptors) evidence.images.insert(id);
  for (const auto& [pair, num] : database.ReadNumMatches()) evidence.matched.insert(pair);
  for (const image_pair_t pair : database.ReadTwoViewGeometryPairIds()) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    if (!evidence.images.contains(id1) || !evidence.images.contains(id2)) continue;
    try {
      evidence.verified[pair] = database.ReadTwoViewGeometry(pair)->inlier_matches;
    } catch (const IoError&) {  // a damaged row: matched, not verified
    }
  }
  return evidence;
}

// The last round that chose pairs for one of these reasons; -1: none did.
int LastRound(const std::vector<PairChoiceRecord>& choices, PairReason first, PairReason last) {
  int round = -1;
  for (const auto& [reason, name] : kPairReasons) {
    if (reason < first || reason > last) continue;
    for (const PairChoiceRecord& choice : choices) {
      if (choice.reason == name) round = std::max(round, choice.round);
    }
  }
  return round;
}

int LastRound(const std::vector<PairChoiceRecord>& choices) {
  return LastRound(choices, PairReason::kExhaustive, PairReason::kWeak);
}

// The last round whose pairs were not proposed by the view graph: of the photographs that joined
// last.
int LastFirstRound(const std::vector<PairChoiceRecord>& choices) {
  return std::max(0, LastRound(choices, PairReason::kExhaustive, PairReason::kRetrieval));
}

// Of the pairs that were chosen for the reason in the latest round that had any: the share that is
// verified; 1 if there was no such round since photographs joined.
double LatestYield(const std::vector<PairChoiceRecord>& choices, const PairEvidence& evidence,
                   PairReason reason) {
  const int latest = LastRound(choices, reason, reason);
  if (latest <= LastFirstRound(choices)) return 1.0;
  int num = 0, num_verified = 0;
  for (const auto& choice : choices) {
    if (choice.reason != NameOf(kPairReasons, reason) || choice.round != latest) continue;
    ++num;
    num_verified += evidence.verified.contains(choice.pair_id);
  }
  return static_cast<double>(num_verified) / num;
}

// By what an image's pairs were chosen, as its record has it. A file of positions may be left out
// where it has nothing more to tell.
struct ChoiceRecord {
  ChoiceRecord(const PairChoosing& choosing, bool is_exhaustive)
      : options_hash(Hasher().Add(PairStageOptions(choosing)).Add(is_exhaustive).Digest()),
        positions(choosing.gps_path.empty() ? "" : HashToHex(HashFile(choosing.gps_path))) {}

  // Those of the images whose pairs are to be chosen.
  std::set<image_t> Fresh(const Database& database, std::set<image_t> images) const {
    for (const JobRecord& job : database.ReadJobs(kStagePairs)) {
      const bool is_done =
          job.input_hash == options_hash && (positions.empty() || job.note == positions);
      if (is_done) images.erase(static_cast<image_t>(job.item));
    }
    return images;
  }

  uint64_t options_hash;
  std::string positions;  // hash of the file
};

}  // namespace

std::string PairStageOptions(const PairChoosing& choosing) {
  return "pairs = \"" + choosing.ways + "\"\n" + DumpQualified("pair_selection", choosing.options);
}

void CheckPairWays(const Database& database, const PairChoosing& choosing, const RunContext& run) {
  const std::vector<PairWay> ways = ParsePairWays(choosing.ways);
  const bool needs_facts = NeedsTimes(ways, choosing.options) || Contains(ways, PairWay::kSpatial);
  if (!needs_facts) return;
  const std::vector<Image> images = database.ReadImages();
  std::set<image_t> ids;
  for (const Image& image : images) ids.insert(image.image_id);
  const ChoiceRecord record(choosing, Contains(ways, PairWay::kExhaustive));
  if (record.Fresh(database, std::move(ids)).empty()) return;
  CheckFacts(ReadPhotoFacts(images, choosing.image_path, choosing.gps_path, run.num_threads),
             images.size(), ways, choosing.options);
}

PairChooser::PairChooser(Database& database, const PairChoosing& choosing, const RunContext& run)
    : database_(database),
      choosing_(choosing),
      run_(run),
      origins_(database),
      images_(database.ReadImages()),
      num_descriptors_(database.ReadNumDescriptors()),
      ways_(ParsePairWays(choosing.ways)) {
  is_auto_ = Uses(PairWay::kAuto);
  if (!is_auto_) return;
  const bool is_quick = ExhaustiveSeconds(num_descriptors_, origins_) <= kMaxExhaustiveSeconds;
  ways_ = {is_quick ? PairWay::kExhaustive : PairWay::kRetrieval};
}

bool PairChooser::Uses(PairWay way) const { return Contains(ways_, way); }

Candidates PairChooser::Find(const Queries& queries, int num) {
  if (!Uses(PairWay::kRetrieval)) return {};
  if (!described_) described_ = DescribeImages(database_, choosing_.options, run_);
  return FindCandidates(*described_, queries, num, run_.num_threads);
}

const Candidates& PairChooser::FirstCandidates() {
  if (!first_candidates_) {
    Queries all;
    for (const auto& [id, num] : num_descriptors_) all[id];
    first_candidates_ = Find(all, kCandidatesPerNeighbor * choosing_.options.retrieval_neighbors);
  }
  return *first_candidates_;
}

void PairChooser::AddSequential(const PhotoFacts& facts, Stage& stage, Choices& choices) {
  const auto add = [&](const std::vector<std::vector<image_t>>& sequences, int overlap,
                       bool quadratic) {
    for (const image_pair_t pair : SequentialPairs(sequences, overlap, quadratic)) {
      choices.emplace(pair, PairReason::kSequential);
    }
  };
  const PairSelectionOptions& options = choosing_.options;
  if (!is_auto_) {
    const bool by_time = options.order == PhotoOrder::kTime;
    const size_t num = facts.taken_at_s.size();
    if (by_time && num < images_.size()) {
      stage.Warn("only " + CountOf(num, images_.size()) +
                 " have a time; the others are in no sequential pair");
    }
    add(by_time ? SequencesByTime(images_, facts.taken_at_s) : SequencesByName(images_),
        options.overlap, options.quadratic_overlap);
    return;
  }
  const std::vector<image_pair_t> alike =
      RetrievalPairs(FirstCandidates(), options.retrieval_neighbors);
  for (const auto& sequences :
       {SequencesByName(images_), SequencesByTime(images_, facts.taken_at_s)}) {
    if (ShareOfAlikeNeighbors(sequences, alike) >= kHalf) add(sequences, kAutoOverlap, false);
  }
}

void PairChooser::AddSpatial(const PhotoFacts& facts, Stage& stage, Choices& choices) {
  const size_t num = facts.positions.size();
  if (!is_auto_ && num < images_.size()) {
    stage.Warn("only " + CountOf(num, images_.size()) +
               " have GPS; the others are in no spatial pair");
  }
  const PairSelectionOptions& options = choosing_.options;
  const int neighbors = is_auto_ ? options.retrieval_neighbors : options.spatial_neighbors;
  for (const image_pair_t pair :
       SpatialPairs(facts.positions, neighbors, options.spatial_radius_m, run_.num_threads)) {
    choices.emplace(pair, PairReason::kSpatial);
  }
}

PairChooser::Choices PairChooser::FirstChoices(Stage& stage) {
  Choices choices;
  if (IsExhaustive()) {
    for (const image_pair_t pair : ExhaustivePairs(num_descriptors_, origins_)) {
      choices.emplace_hint(choices.end(), pair, PairReason::kExhaustive);
    }
    return choices;
  }
  PhotoFacts facts;
  if (is_auto_ || NeedsTimes(ways_, choosing_.options) || Uses(PairWay::kSpatial)) {
    facts = ReadPhotoFacts(images_, choosing_.image_path, choosing_.gps_path, run_.num_threads);
    CheckFacts(facts, images_.size(), ways_, choosing_.options);
  }
  if (is_auto_ || Uses(PairWay::kSequential)) AddSequential(facts, stage, choices);
  if (is_auto_ || Uses(PairWay::kSpatial)) AddSpatial(facts, stage, choices);
  for (const image_pair_t pair :
       RetrievalPairs(FirstCandidates(), choosing_.options.retrieval_neighbors)) {
    choices.emplace(pair, PairReason::kRetrieval);
  }
  return choices;
}

PairChooser::Choices PairChooser::NextChoices(const std::vector<PairChoiceRecord>& records) {
  Choices choices;
  const PairEvidence evidence = ReadEvidence(database_, num_descriptors_);
  const auto add = [&](const std::vector<image_pair_t>& pairs, PairReason reason) {
    for (const image_pair_t pair : pairs) choices.emplace(pair, reason);
  };
  const auto yields = [&](PairReason reason) { return LatestYield(records, evidence, reason); };
  const PairSelectionOptions& options = choosing_.options;
  if (yields(PairReason::kTwoEdges) >= kHalf) {
    const std::vector<image_pair_t> pairs =
        PairsTwoEdgesApart(evidence, options.min_shared_points,
                           kEnough * options.retrieval_neighbors, run_.num_threads);
    const auto num_since = std::ranges::count_if(
        records, [first = LastFirstRound(records)](const PairChoiceRecord& record) {
          return record.round >= first;
        });
    const double min_num = kMinGrowth * static_cast<double>(num_since);
    if (static_cast<double>(pairs.size()) >= min_num) add(pairs, PairReason::kTwoEdges);
  }
  if (yields(PairReason::kLoop) >= kHalf) {
    const Candidates found =
        Find(AskForLoops(evidence, run_.num_threads), options.retrieval_neighbors);
    add(PairsClosingLoops(evidence, FirstCandidates(), found), PairReason::kLoop);
  }
  if (yields(PairReason::kWeak) > 0) {
    const int num = kCandidatesPerNeighbor * options.retrieval_neighbors;
    add(RetrievalPairs(Find(AskForWeakImages(evidence), num), options.retrieval_neighbors),
        PairReason::kWeak);
  }
  return choices;
}

std::vector<image_pair_t> PairChooser::Write(const Choices& choices, int round) {
  std::vector<image_pair_t> added;
  const auto matched = database_.ReadNumMatches();
  const auto recorded = Chosen();
  for (const auto& [pair, reason] : choices) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    if (!num_descriptors_.contains(id1) || !num_descriptors_.contains(id2)) continue;
    const auto row = std::lower_bound(matched.begin(), matched.end(), std::pair(pair, 0));
    if (row != matched.end() && row->first == pair) continue;
    if (origins_.AreGiven(pair)) continue;
    if (std::binary_search(recorded.begin(), recorded.end(), pair)) continue;
    database_.WritePairChoice({pair, round, std::string(NameOf(kPairReasons, reason))});
    added.push_back(pair);
  }
  return added;
}

void PairChooser::WriteStage(bool is_complete) {
  database_.WriteStage({kStagePairs, PairStageOptions(choosing_), is_complete});
}

StageReport PairChooser::ChooseFirst() {
  Stage stage(run_.monitor, kStagePairs);
  const ChoiceRecord record(choosing_, IsExhaustive());
  std::set<image_t> fresh;
  for (const auto& [id, num] : num_descriptors_) fresh.insert(id);
  fresh = record.Fresh(database_, std::move(fresh));
  size_t num_new = 0;
  if (!fresh.empty()) {
    Choices choices = FirstChoices(stage);
    if (run_.monitor.StopRequested()) {
      stage.MarkStopped();
      return stage.Finish();
    }
    std::erase_if(choices, [&](const auto& choice) {
      const auto [id1, id2] = PairIdToImagePair(choice.first);
      return !fresh.contains(id1) && !fresh.contains(id2);
    });
    Database::Transaction transaction(database_);
    num_new = Write(choices, LastRound(database_.ReadPairChoices()) + 1).size();
    for (const image_t id : fresh) {
      database_.WriteJob(kStagePairs, {id, record.options_hash, record.positions});
    }
    WriteStage(IsExhaustive());
    transaction.Commit();
  }
  stage.Add("images", fresh.size());
  stage.Add("chosen", num_new);
  return EndStage(stage, database_);
}

std::vector<image_pair_t> PairChooser::ChooseNext() {
  const std::optional<StageRecord> record = database_.ReadStage(kStagePairs);
  if (!record || record->is_complete) return {};
  const Timer timer;
  const std::vector<PairChoiceRecord> records = database_.ReadPairChoices();
  const int last_round = LastRound(records);
  const bool is_last = last_round - LastFirstRound(records) >= choosing_.options.max_rounds;
  Choices choices;
  if (!is_last) choices = NextChoices(records);
  if (run_.monitor.StopRequested()) return {};
  Database::Transaction transaction(database_);
  std::vector<image_pair_t> added = Write(choices, last_round + 1);
  if (added.empty()) WriteStage(true);
  transaction.Commit();
  if (!added.empty()) {
    run_.monitor.Info("round " + std::to_string(last_round + 1) + ": " +
                      std::to_string(added.size()) + " pairs proposed by the view graph");
  }
  database_.AddStageTime(kStagePairs, timer.Seconds());
  return added;
}

std::vector<image_pair_t> PairChooser::Chosen() const {
  std::vector<image_pair_t> pairs;
  for (const auto& choice : database_.ReadPairChoices()) pairs.push_back(choice.pair_id);
  return pairs;
}

}  // namespace cairn
