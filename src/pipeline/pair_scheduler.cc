#include "cairn/pipeline/pair_scheduler.h"

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/memory.h"
#include "cairn/base/parallel.h"
#include "cairn/base/timer.h"
#include "cairn/database/database_writer.h"
#include "pipeline/depth_choice.h"
#include "pipeline/depth_learning.h"
#include "pipeline/pair_feed.h"
#include "pipeline/pair_loader.h"
#include "pipeline/pair_outcome.h"
#include "pipeline/stage_ledger.h"
#include "pipeline/stage_names.h"
#include "pipeline/stage_report.h"
#include "pipeline/verification_rounds.h"

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

// One thread's verifiers.
class Worker {
 public:
  Worker(const std::vector<NamedVerifier>& verifiers, const VerificationInput& input,
         const std::map<image_t, ImageDepth>& learned_depth)
      : input_(input), learned_depth_(learned_depth) {
    for (const NamedVerifier& verifier : verifiers) {
      names_.push_back(verifier.name);
      verifiers_.push_back(verifier.make());
    }
  }

  PairOutcome Run(const PairTask& task) {
    PairOutcome outcome;
    outcome.pair_id = task.pair_id;
    outcome.input_hash = task.input_hash;
    outcome.num_matches = static_cast<int>(task.matches.size());
    if (!task.image1) return outcome;  // Too few matches.
    PairInput pair;
    pair.pair_id = task.pair_id;
    pair.seed = input_.seed;
    pair.camera1 = &task.image1->camera;
    pair.camera2 = &task.image2->camera;
    pair.keypoints1 = task.image1->keypoints;
    pair.keypoints2 = task.image2->keypoints;
    pair.depth1 = task.image1->depth;
    pair.depth2 = task.image2->depth;
    pair.matches = task.matches;
    const auto [id1, id2] = PairIdToImagePair(task.pair_id);
    pair.depth_trust1 = TrustIn(id1);
    pair.depth_trust2 = TrustIn(id2);
    for (size_t i = 0; i < verifiers_.size(); ++i) {
      const Timer timer;
      PairReport report = verifiers_[i]->Verify(pair);
      const double seconds = timer.Seconds();
      verifying_seconds += seconds;
      outcome.runs.push_back({names_[i], std::move(report), seconds});
    }
    outcome.winner = ChooseWinner(outcome.runs);
    return outcome;
  }

  double verifying_seconds = 0;

 private:
  // 1 where nothing is known.
  double TrustIn(image_t id) const {
    const auto learned = learned_depth_.find(id);
    return learned == learned_depth_.end() ? 1.0 : DepthTrust(learned->second);
  }

  const VerificationInput& input_;
  const std::map<image_t, ImageDepth>& learned_depth_;
  std::vector<std::string> names_;
  std::vector<std::unique_ptr<PairVerifier>> verifiers_;
};

void Count(const PairOutcome& outcome, VerificationCounts& counts) {
  ++counts.num_pairs;
  if (outcome.runs.empty()) {
    ++counts.num_too_few;
  } else {
    ++counts.num_tried;
  }
  if (outcome.winner >= 0) {
    ++counts.num_verified;
    ++counts.verified_by[outcome.runs[outcome.winner].verifier];
  } else {
    ++counts.rejected_by[outcome.RejectionReason()];
  }
}

std::map<image_t, int64_t> ImageBytes(const Database& database) {
  std::map<image_t, int64_t> bytes;
  for (const auto& [id, num] : database.ReadNumKeypoints()) bytes[id] = num * kBytesPerKeypoint;
  return bytes;
}

// Verifies the pairs of the plan; adds to the counts and times.
void RunRound(Database& database, const std::vector<NamedVerifier>& verifiers,
              const VerificationInput& input, PairLoader& loader, std::vector<PairTile> plan,
              int64_t num_pairs, int64_t max_queue_bytes, int num_threads, ProgressMonitor& monitor,
              VerificationReport& report) {
  const std::map<image_t, ImageDepth> learned_depth = database.ReadImageDepth();
  loader.UseLearnedDepth(learned_depth);
  DatabaseWriter writer(database.path());
  PairFeed feed(
      std::move(plan), [&loader](image_t id) { return loader.LoadImage(id); },
      [&loader](PairTask& task, const auto& image) { return loader.LoadPair(task, image); },
      max_queue_bytes);
  const int num_workers = EffectiveNumThreads(num_threads);
  std::vector<std::unique_ptr<Worker>> workers(num_workers);
  std::mutex counts_mutex;
  ParallelForWorker(num_workers, num_pairs, [&](int worker, int64_t) {
    if (monitor.StopRequested()) feed.Stop();
    const std::optional<PairTask> task = feed.Next();
    if (!task) return;
    if (!workers[worker]) {
      workers[worker] = std::make_unique<Worker>(verifiers, input, learned_depth);
    }
    auto outcome = std::make_shared<PairOutcome>(workers[worker]->Run(*task));
    {
      const std::lock_guard<std::mutex> lock(counts_mutex);
      Count(*outcome, report.counts);
    }
    writer.Push([outcome](Database& db) { WriteOutcome(db, *outcome); });
    monitor.Advance(1);
  });
  writer.Finish();
  report.writing_seconds += writer.busy_seconds();
  for (const auto& worker : workers) {
    if (worker) report.verifying_seconds += worker->verifying_seconds;
  }
}

// The likely pairs first, then the others.
void RunRounds(Database& database, const std::vector<NamedVerifier>& verifiers,
               const VerificationInput& input, const SchedulerOptions& scheduler,
               const StageLedger& ledger, const std::vector<image_pair_t>& pairs,
               const std::vector<std::pair<image_pair_t, int>>& num_matches, int num_threads,
               ProgressMonitor& monitor, VerificationReport& report) {
  const std::vector<image_pair_t> likely = LikelyPairs(num_matches, kLikelyPairsPerImage);
  std::vector<image_pair_t> rounds[2];
  for (const image_pair_t pair : pairs) {
    rounds[std::binary_search(likely.begin(), likely.end(), pair) ? 0 : 1].push_back(pair);
  }
  // Half for the present tile; tasks that still hold images of the last one have the rest.
  const auto max_bytes = GibToBytes(scheduler.max_memory_gib) / 2;
  const std::map<image_t, int64_t> image_bytes = ImageBytes(database);
  PairLoader loader(database.path(), input.min_num_matches, ledger, monitor);
  for (const std::vector<image_pair_t>& round : rounds) {
    RunRound(database, verifiers, input, loader, PlanPairTiles(round, image_bytes, max_bytes),
             static_cast<int64_t>(round.size()), max_bytes / 8, num_threads, monitor, report);
    if (monitor.StopRequested()) break;
    if (&round == rounds) {
      const Timer timer;
      LearnDepth(database, likely, num_matches, max_bytes, num_threads, monitor);
      report.learning_seconds = timer.Seconds();
    }
  }
  report.stage.messages = loader.messages();
  report.reading_seconds = loader.busy_seconds();
}

void FillStageReport(VerificationReport& report) {
  const VerificationCounts& counts = report.counts;
  StageReport& stage = report.stage;
  stage.Add("pairs", static_cast<double>(counts.num_pairs));
  stage.Add("tried", static_cast<double>(counts.num_tried));
  stage.Add("verified", static_cast<double>(counts.num_verified));
  for (const auto& [verifier, num] : counts.verified_by) {
    stage.Add("verified_by_" + verifier, static_cast<double>(num));
  }
  for (const auto& [reason, num] : counts.rejected_by) {
    stage.Add("rejected_" + reason, static_cast<double>(num));
  }
  stage.Add("learning_seconds", report.learning_seconds);
  stage.Add("verifying_seconds", report.verifying_seconds);
  stage.Add("reading_seconds", report.reading_seconds);
  stage.Add("writing_seconds", report.writing_seconds);
}

}  // namespace

VerificationReport VerifyPairs(Database& database, const std::vector<NamedVerifier>& verifiers,
                               const VerificationInput& input, const SchedulerOptions& scheduler,
                               int num_threads, ProgressMonitor& monitor) {
  CAIRN_CHECK(!verifiers.empty());
  const Timer timer;
  VerificationReport report;
  report.stage.name = kStageVerification;
  StageLedger ledger(database, kStageVerification, input.options);
  const auto num_matches = database.ReadNumMatches();
  const std::vector<image_pair_t> pairs = FindPairs(database, num_matches, input, ledger);
  const auto num_new =
      static_cast<int64_t>(std::count_if(pairs.begin(), pairs.end(), [&ledger](image_pair_t pair) {
        return ledger.Find(pair) == nullptr;
      }));
  if (!pairs.empty()) {
    if (num_new > 0) ledger.Begin(database);
    monitor.BeginStage("verifying pairs", num_new);
    RunRounds(database, verifiers, input, scheduler, ledger, pairs, num_matches, num_threads,
              monitor, report);
    monitor.EndStage();
  }
  if (monitor.StopRequested()) {
    MarkStopped(report.stage);
  } else {
    ledger.Complete(database);
    if (!report.stage.messages.empty()) report.stage.status = StageStatus::kWarning;
  }
  FillStageReport(report);
  report.stage.seconds = timer.Seconds();
  database.AddTiming(kStageVerification, 0, "", report.stage.seconds);
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
