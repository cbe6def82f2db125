#include "cairn/pipeline/verify_pairs.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <unordered_map>

#include "base/memory.h"
#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/base/timer.h"
#include "database/database_writer.h"
#include "database/match_origins.h"
#include "database/stage_names.h"
#include "intrinsics/focal_learning.h"
#include "intrinsics/lens_learning.h"
#include "pipeline/machines/helpers.h"
#include "pipeline/pairs/feed.h"
#include "pipeline/pairs/load.h"
#include "pipeline/pairs/plan.h"
#include "pipeline/pairs/verify.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

// A keypoint with its depth sample in memory.
constexpr int64_t kBytesPerKeypoint = sizeof(Keypoint) + sizeof(DepthSample);

// So many of an image's most-matched pairs are in the first round.
constexpr int kLikelyPairsPerImage = 5;

// Did the program that verified the pair tell more than its inliers? A damaged row stays.
bool IsTold(const Database& database, image_pair_t pair) {
  try {
    return database.HasGeometry(pair);
  } catch (const IoError&) {
    return true;
  }
}

// Pairs that are given to the reading thread: those with matches, but not those that another
// program verified, and told how. Of pairs that are not listed, those of earlier runs: what was
// found of them may have been undone.
std::vector<image_pair_t> FindPairs(const Database& database,
                                    const std::vector<std::pair<image_pair_t, int>>& num_matches,
                                    const VerificationInput& input, const StageLedger& ledger) {
  std::vector<image_pair_t> given;
  for (const auto& [pair, num] : database.ReadNumInliers()) {
    if (ledger.Find(pair) == nullptr && (num == 0 || IsTold(database, pair))) given.push_back(pair);
  }
  const MatchOrigins origins(database);
  const auto is_listed = [&](image_pair_t pair) {
    return !input.pairs || std::binary_search(input.pairs->begin(), input.pairs->end(), pair);
  };
  std::vector<image_pair_t> pairs;
  for (const auto& [pair, num] : num_matches) {
    if (std::binary_search(given.begin(), given.end(), pair)) continue;
    if (is_listed(pair) || origins.AreOurs(pair)) pairs.push_back(pair);
  }
  return pairs;
}

std::map<image_t, int64_t> ImageBytes(const Database& database) {
  std::map<image_t, int64_t> bytes;
  for (const auto& [id, num] : database.ReadNumKeypoints()) bytes[id] = num * kBytesPerKeypoint;
  return bytes;
}

// The stage: what its rounds share, and what they leave behind.
class Verification {
 public:
  Verification(Database& database, const std::vector<NamedVerifier>& verifiers,
               const VerificationInput& input, const RunContext& run, Helpers* helpers)
      : database_(database),
        verifiers_(verifiers),
        input_(input),
        run_(run),
        helpers_(helpers),
        stage_(run.monitor, kStageVerification),
        record_(database.ReadStage(kStageVerification)),
        ledger_(database, kStageVerification, input.options),
        // Half for the present tile; tasks that still hold images of the last one have the rest.
        max_bytes_(GibToBytes(input.scheduler.max_memory_gib) / 2),
        image_bytes_(ImageBytes(database)),
        loader_(database.path(), input.min_num_matches, ledger_, stage_) {}

  StageReport Run() {
    const auto num_matches = database_.ReadNumMatches();
    const std::vector<image_pair_t> pairs = FindPairs(database_, num_matches, input_, ledger_);
    const auto num_new = std::ranges::count_if(
        pairs, [this](image_pair_t pair) { return ledger_.Find(pair) == nullptr; });
    if (!pairs.empty()) {
      if (num_new > 0) ledger_.Begin(database_);
      run_.monitor.BeginStage("verifying pairs", num_new);
      // What is complete stays as it is.
      const bool may_learn = num_new > 0 || (record_ && !record_->is_complete);
      RunRounds(pairs, num_matches, may_learn);
      run_.monitor.EndStage();
    }
    AddValues();
    WarnOfLeftOut();
    return EndStage(stage_, run_, ledger_, database_);
  }

 private:
  // What was found last of a pair.
  struct Finding {
    bool is_tried = false, is_verified = false;
    std::string name;  // of the verifier that won, or the reason of the rejection
  };

  // The likely pairs first, then the others.
  void RunRounds(const std::vector<image_pair_t>& pairs,
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
    RunRound(first);
    if (!run_.monitor.StopRequested() && may_learn) {
      const std::vector<image_pair_t> undone = LearnLens(likely);
      to_weigh_ = PairsToWeigh(database_, ours);
      RunAgain(first, undone);
    }
    if (!run_.monitor.StopRequested()) WeighFocals();
    if (!run_.monitor.StopRequested()) RunAgain(first, JudgeFocals());
    if (!run_.monitor.StopRequested()) RunRound(second);
  }

  void AddValues() {
    int64_t num_tried = 0, num_verified = 0;
    std::map<std::string, int64_t> rejected_by, verified_by;
    for (const auto& [pair, finding] : findings_) {
      num_tried += finding.is_tried;
      num_verified += finding.is_verified;
      ++(finding.is_verified ? verified_by : rejected_by)[finding.name];
    }
    stage_.Add("pairs", std::ssize(findings_));
    stage_.Add("tried", num_tried);
    stage_.Add("verified", num_verified);
    for (const auto& [verifier, num] : verified_by) stage_.Add("verified_by_" + verifier, num);
    for (const auto& [reason, num] : rejected_by) stage_.Add("rejected_" + reason, num);
    stage_.Add("learned_lenses", num_learned_lenses_);
    stage_.Add("rejected_focals", num_rejected_focals_);
    stage_.Add("learning_seconds", learning_seconds_);
  }

  void WarnOfLeftOut() {
    const auto& left_out = loader_.left_out();
    if (left_out.empty()) return;
    const std::string pairs = left_out.size() == 1 ? " pair is" : " pairs are";
    stage_.Warn(ResultWarning{std::to_string(left_out.size()) + pairs + " left out; for example, " +
                                  left_out.begin()->second,
                              "write these matches again, for the keypoints that are there"});
  }

  // Verifies pairs that are not done.
  void RunRound(const std::vector<image_pair_t>& pairs) {
    loader_.BeginRound();
    std::mutex findings_mutex;
    VerifyEach(pairs, [&](PairOutcome found, DatabaseWriter& writer) {
      const auto outcome = std::make_shared<PairOutcome>(std::move(found));
      const bool is_verified = outcome->winner >= 0;
      bool is_new = true;
      {
        const std::lock_guard<std::mutex> lock(findings_mutex);
        is_new = findings_
                     .insert_or_assign(outcome->pair_id,
                                       Finding{!outcome->runs.empty(), is_verified,
                                               is_verified ? outcome->runs[outcome->winner].verifier
                                                           : outcome->RejectionReason()})
                     .second;
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
    loader_.BeginDoneAgain();
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
    std::vector<TaskVerifier> workers;
    for (int i = 0; i < EffectiveNumThreads(run_.num_threads); ++i) {
      workers.emplace_back(verifiers_, run_.seed);
    }
    ForEachTask<PairOutcome>(
        TaskKind::kVerify, feed, helpers_, run_,
        [&](int worker, const PairTask& task) { return workers[worker].Run(task); },
        [&](PairOutcome outcome, const std::string&) { keep(std::move(outcome), writer); });
    writer.Finish();
  }

  // The pairs of the first round that are undone.
  void RunAgain(const std::vector<image_pair_t>& first, const std::vector<image_pair_t>& undone) {
    std::vector<image_pair_t> again;
    std::set_intersection(first.begin(), first.end(), undone.begin(), undone.end(),
                          std::back_inserter(again));
    if (!again.empty()) RunRound(again);
  }

  // Learns unknown distortions and focal lengths; returns the pairs to be verified again.
  std::vector<image_pair_t> LearnLens(const std::vector<image_pair_t>& likely) {
    const Timer timer;
    const LearnedLenses learned = LearnLenses(database_, likely, run_);
    for (const image_pair_t pair : learned.undone) ledger_.Forget(pair);
    stage_.NoteEach(learned.texts);
    num_learned_lenses_ = std::ssize(learned.texts);
    learning_seconds_ += timer.Seconds();
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
    num_rejected_focals_ = std::ssize(learned.rejected);
    learning_seconds_ += timer.Seconds();
    return learned.undone;
  }

  Database& database_;
  const std::vector<NamedVerifier>& verifiers_;
  const VerificationInput& input_;
  const RunContext& run_;
  Helpers* const helpers_;
  Stage stage_;
  const std::optional<StageRecord> record_;  // before this run
  StageLedger ledger_;
  const int64_t max_bytes_;
  const std::map<image_t, int64_t> image_bytes_;
  PairLoader loader_;
  std::vector<image_pair_t> to_weigh_;
  std::unordered_map<image_pair_t, Finding> findings_;
  int64_t num_learned_lenses_ = 0, num_rejected_focals_ = 0;
  double learning_seconds_ = 0;
};

}  // namespace

StageReport VerifyPairs(Database& database, const std::vector<NamedVerifier>& verifiers,
                        const VerificationInput& input, const RunContext& run, Helpers* helpers) {
  CAIRN_CHECK(!verifiers.empty());
  return Verification(database, verifiers, input, run, helpers).Run();
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
