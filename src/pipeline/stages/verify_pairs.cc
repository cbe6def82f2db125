#include "cairn/pipeline/verify_pairs.h"

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <mutex>

#include "base/memory.h"
#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/base/timer.h"
#include "database/database_writer.h"
#include "database/stage_names.h"
#include "intrinsics/focal_learning.h"
#include "intrinsics/lens_learning.h"
#include "pipeline/machines/helpers.h"
#include "pipeline/pairs/feed.h"
#include "pipeline/pairs/load.h"
#include "pipeline/pairs/rounds.h"
#include "pipeline/pairs/verify.h"
#include "pipeline/pairs/write.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

// A keypoint with its depth sample in memory.
constexpr int64_t kBytesPerKeypoint = sizeof(Keypoint) + sizeof(DepthSample);

// So many of an image's most-matched pairs are in the first round.
constexpr int kLikelyPairsPerImage = 5;

// Pairs that are given to the reading thread: those with matches, but not those that another
// program verified.
std::vector<image_pair_t> FindPairs(const Database& database,
                                    const std::vector<std::pair<image_pair_t, int>>& num_matches,
                                    const VerificationInput& input, const StageLedger& ledger) {
  std::vector<image_pair_t> given;
  for (const auto& [pair, num] : database.ReadNumInliers()) {
    if (ledger.Find(pair) == nullptr) given.push_back(pair);
  }
  std::vector<image_pair_t> pairs;
  for (const auto& [pair, num] : num_matches) {
    if (std::binary_search(given.begin(), given.end(), pair)) continue;
    if (input.pairs && !std::binary_search(input.pairs->begin(), input.pairs->end(), pair))
      continue;
    pairs.push_back(pair);
  }
  return pairs;
}

// Counts each pair once, by what was found last.
class OutcomeCounter {
 public:
  explicit OutcomeCounter(VerificationCounts* counts) : counts_(*counts) {}

  // False: the pair was there before. Only pairs that are `remembered` may come again.
  bool Add(const PairOutcome& outcome, bool remembered) {
    Entry entry = {!outcome.runs.empty(), outcome.winner >= 0, {}};
    entry.name =
        entry.is_verified ? outcome.runs[outcome.winner].verifier : outcome.RejectionReason();
    const auto before = entries_.find(outcome.pair_id);
    const bool is_new = before == entries_.end();
    if (!is_new) Count(before->second, -1);
    Count(entry, 1);
    if (remembered) entries_[outcome.pair_id] = std::move(entry);
    return is_new;
  }

 private:
  struct Entry {
    bool is_tried, is_verified;
    std::string name;  // of the verifier, or the reason
  };

  void Count(const Entry& entry, int sign) {
    counts_.num_pairs += sign;
    (entry.is_tried ? counts_.num_tried : counts_.num_too_few) += sign;
    if (entry.is_verified) counts_.num_verified += sign;
    auto& counts = entry.is_verified ? counts_.verified_by : counts_.rejected_by;
    if ((counts[entry.name] += sign) == 0) counts.erase(entry.name);
  }

  VerificationCounts& counts_;
  std::map<image_pair_t, Entry> entries_;
};

std::map<image_t, int64_t> ImageBytes(const Database& database) {
  std::map<image_t, int64_t> bytes;
  for (const auto& [id, num] : database.ReadNumKeypoints()) bytes[id] = num * kBytesPerKeypoint;
  return bytes;
}

// What VerifyPairs was given.
struct Verification {
  Database& database;
  const std::vector<NamedVerifier>& verifiers;
  const VerificationInput& input;
  const SchedulerOptions& scheduler;
  const RunContext& run;
  Helpers* helpers;
};

// The rounds of a run: what they share, and what they leave behind.
class Rounds {
 public:
  Rounds(const Verification& verification, StageLedger& ledger, Stage& stage,
         VerificationReport& report)
      : database_(verification.database),
        verifiers_(verification.verifiers),
        run_(verification.run),
        helpers_(verification.helpers),
        ledger_(ledger),
        stage_(stage),
        report_(report),
        counter_(&report.counts),
        // Half for the present tile; tasks that still hold images of the last one have the rest.
        max_bytes_(GibToBytes(verification.scheduler.max_memory_gib) / 2),
        image_bytes_(ImageBytes(database_)),
        loader_(database_.path(), verification.input.min_num_matches, SumOfBytes() <= max_bytes_,
                ledger, run_.monitor) {}

  // The likely pairs first, then the others.
  void Run(const std::vector<image_pair_t>& pairs,
           const std::vector<std::pair<image_pair_t, int>>& num_matches, bool may_learn) {
    const std::vector<image_pair_t> likely = LikelyPairs(num_matches, kLikelyPairsPerImage);
    std::vector<image_pair_t> first, second;
    for (const image_pair_t pair : pairs) {
      (std::binary_search(likely.begin(), likely.end(), pair) ? first : second).push_back(pair);
    }
    std::vector<image_pair_t> ours = likely;  // of them, those of this list or one before
    std::erase_if(ours, [&](image_pair_t pair) {
      return ledger_.Find(pair) == nullptr && !std::binary_search(first.begin(), first.end(), pair);
    });
    to_weigh_ = PairsToWeigh(database_, ours);
    RunRound(first, true);
    if (!run_.monitor.StopRequested() && may_learn) {
      const std::vector<image_pair_t> undone = LearnLens(likely);
      to_weigh_ = PairsToWeigh(database_, ours);
      RunAgain(first, undone);
    }
    if (!run_.monitor.StopRequested()) WeighFocals();
    if (!run_.monitor.StopRequested()) RunAgain(first, JudgeFocals());
    if (!run_.monitor.StopRequested()) RunRound(second, false);
    for (const std::string& message : loader_.messages()) stage_.Keep(message);
    report_.reading_seconds = loader_.busy_seconds();
  }

 private:
  int64_t SumOfBytes() const {
    int64_t sum = 0;
    for (const auto& [id, bytes] : image_bytes_) sum += bytes;
    return sum;
  }

  // Verifies pairs that are not done; adds to the counts and times.
  void RunRound(const std::vector<image_pair_t>& pairs, bool may_come_again) {
    loader_.BeginRound();
    std::mutex counts_mutex;
    VerifyEach(pairs, [&](PairOutcome found, DatabaseWriter& writer) {
      const auto outcome = std::make_shared<PairOutcome>(std::move(found));
      bool is_new = true;
      {
        const std::lock_guard<std::mutex> lock(counts_mutex);
        is_new = counter_.Add(*outcome, may_come_again);
        for (const PairOutcome::Run& run : outcome->runs) report_.verifying_seconds += run.seconds;
      }
      writer.Push([outcome](Database& db) { WriteOutcome(db, *outcome); });
      if (is_new) run_.monitor.Advance(1);
    });
  }

  // Collects the evidence about prior focal lengths that is missing: of pairs that were verified
  // before they were drawn, or while one of the priors was rejected.
  void WeighFocals() {
    const std::vector<image_pair_t> missing = WithoutEvidence(database_, to_weigh_);
    if (missing.empty()) return;
    loader_.BeginDoneAgain(PairLoader::Priors::kUnjudged);
    VerifyEach(missing, [](PairOutcome found, DatabaseWriter& writer) {
      writer.Push([outcome = std::make_shared<PairOutcome>(std::move(found))](Database& db) {
        WriteFocalEvidence(db, *outcome);
      });
    });
  }

  // Verifies the pairs that the loader reads; `keep` gets what is found, from any thread.
  void VerifyEach(const std::vector<image_pair_t>& pairs,
                  const std::function<void(PairOutcome, DatabaseWriter&)>& keep) {
    DatabaseWriter writer(database_.path());
    PairFeed feed(
        PlanPairTiles(pairs, image_bytes_, max_bytes_),
        [this](image_t id) { return loader_.LoadImage(id); },
        [this](PairTask& task, const auto& image) {
          task.weigh_focals = std::binary_search(to_weigh_.begin(), to_weigh_.end(), task.pair_id);
          return loader_.LoadPair(task, image);
        },
        max_bytes_ / 8);
    const int num_workers = EffectiveNumThreads(run_.num_threads);
    std::vector<TaskVerifier> workers;
    for (int i = 0; i < num_workers; ++i) workers.emplace_back(verifiers_, run_.seed);
    HelperLoop loop(helpers_,
                    PairWork(TaskKind::kVerify, feed,
                             [&](ByteSource& result) { keep(result.Get<PairOutcome>(), writer); }),
                    run_);
    ParallelForWorker(num_workers, std::ssize(pairs), [&](int worker, int64_t) {
      if (run_.monitor.StopRequested()) feed.Stop();
      const std::optional<PairTask> task = feed.Next();
      if (task) keep(workers[worker].Run(*task), writer);
    });
    loop.Finish();
    writer.Finish();
    report_.writing_seconds += writer.busy_seconds();
  }

  // The pairs of the first round that are undone.
  void RunAgain(const std::vector<image_pair_t>& first, const std::vector<image_pair_t>& undone) {
    std::vector<image_pair_t> again;
    std::set_intersection(first.begin(), first.end(), undone.begin(), undone.end(),
                          std::back_inserter(again));
    if (!again.empty()) RunRound(again, true);
  }

  // Learns unknown distortions and focal lengths; returns the pairs to be verified again.
  std::vector<image_pair_t> LearnLens(const std::vector<image_pair_t>& likely) {
    const Timer timer;
    const LearnedLenses learned = LearnLenses(database_, likely, run_);
    for (const image_pair_t pair : learned.undone) ledger_.Forget(pair);
    stage_.NoteEach(learned.texts);
    report_.num_learned_lenses = static_cast<int>(learned.texts.size());
    report_.learning_seconds += timer.Seconds();
    return learned.undone;
  }

  // Learns which prior focal lengths are wrong; returns the pairs to be verified again.
  std::vector<image_pair_t> JudgeFocals() {
    const Timer timer;
    const LearnedFocals learned = LearnFocals(database_, to_weigh_);
    for (const image_pair_t pair : learned.undone) ledger_.Forget(pair);
    stage_.WarnEach(RejectedFocalTexts(database_, learned.rejected));
    std::vector<std::string> restored;
    for (const camera_t id : learned.restored) {
      restored.push_back("camera " + std::to_string(id) +
                         ": its prior focal length is no longer rejected, by the pairs of today");
    }
    stage_.NoteEach(restored);
    report_.num_rejected_focals = static_cast<int>(learned.rejected.size());
    report_.learning_seconds += timer.Seconds();
    return learned.undone;
  }

  Database& database_;
  const std::vector<NamedVerifier>& verifiers_;
  const RunContext& run_;
  Helpers* const helpers_;
  StageLedger& ledger_;
  Stage& stage_;
  VerificationReport& report_;
  OutcomeCounter counter_;
  const int64_t max_bytes_;
  const std::map<image_t, int64_t> image_bytes_;
  PairLoader loader_;
  std::vector<image_pair_t> to_weigh_;
};

void AddValues(const VerificationReport& report, Stage& stage) {
  const VerificationCounts& counts = report.counts;
  stage.Add("pairs", counts.num_pairs);
  stage.Add("tried", counts.num_tried);
  stage.Add("verified", counts.num_verified);
  for (const auto& [verifier, num] : counts.verified_by) {
    stage.Add("verified_by_" + verifier, num);
  }
  for (const auto& [reason, num] : counts.rejected_by) {
    stage.Add("rejected_" + reason, num);
  }
  stage.Add("learned_lenses", report.num_learned_lenses);
  stage.Add("rejected_focals", report.num_rejected_focals);
  stage.Add("learning_seconds", report.learning_seconds);
  stage.Add("verifying_seconds", report.verifying_seconds);
  stage.Add("reading_seconds", report.reading_seconds);
  stage.Add("writing_seconds", report.writing_seconds);
}

}  // namespace

VerificationReport VerifyPairs(Database& database, const std::vector<NamedVerifier>& verifiers,
                               const VerificationInput& input, const SchedulerOptions& scheduler,
                               const RunContext& run, Helpers* helpers) {
  CAIRN_CHECK(!verifiers.empty());
  Stage stage(run.monitor, kStageVerification);
  VerificationReport report;
  const std::optional<StageRecord> record = database.ReadStage(kStageVerification);
  StageLedger ledger(database, kStageVerification, input.options);
  const auto num_matches = database.ReadNumMatches();
  const std::vector<image_pair_t> pairs = FindPairs(database, num_matches, input, ledger);
  const auto num_new =
      static_cast<int64_t>(std::count_if(pairs.begin(), pairs.end(), [&ledger](image_pair_t pair) {
        return ledger.Find(pair) == nullptr;
      }));
  if (!pairs.empty()) {
    if (num_new > 0) ledger.Begin(database);
    run.monitor.BeginStage("verifying pairs", num_new);
    // What is complete stays as it is.
    const bool may_learn = num_new > 0 || (record && !record->is_complete);
    Rounds({database, verifiers, input, scheduler, run, helpers}, ledger, stage, report)
        .Run(pairs, num_matches, may_learn);
    run.monitor.EndStage();
  }
  AddValues(report, stage);
  report.stage = EndStage(stage, run, ledger, database);
  return report;
}

std::vector<NamedVerifier> MakeVerifiers(const std::string& choice, const TwoViewOptions& options) {
  auto make = [&options](const std::string& name) {
    const VerifierKind kind = VerifierKindFromName(name);
    return NamedVerifier{name, [kind, options] { return MakePairVerifier(kind, options); }};
  };
  if (choice == "both") return {make("one_ac_depth"), make("five_point")};
  return {make(choice)};
}

}  // namespace cairn
