#include "pipeline/depth_gain.h"

#include <memory>

#include "cairn/base/rng.h"
#include "cairn/base/timer.h"
#include "database/stage_names.h"
#include "pipeline/pairs/load.h"
#include "pipeline/pairs/verify.h"

namespace cairn {
namespace {

constexpr int kMaxSampledPairs = 20;
constexpr double kSampleShare = 0.02;  // of the budget

// Pairs that were tried, whose images both have depth, in random order.
std::vector<image_pair_t> PairsWithDepth(const Database& database, uint64_t seed) {
  const std::map<image_t, int> num_depths = database.ReadNumDepthSamples();
  std::vector<image_pair_t> pairs;
  if (num_depths.empty()) return pairs;
  for (const PairMetrics& metrics : database.ReadPairMetrics()) {
    const auto [id1, id2] = PairIdToImagePair(metrics.pair_id);
    if (num_depths.count(id1) && num_depths.count(id2)) pairs.push_back(metrics.pair_id);
  }
  Rng(seed, "depth_gain").Shuffle(pairs);
  return pairs;
}

PairFeed::ImagePtr WithoutDepth(PairImage image) {
  image.depth.clear();
  return std::make_shared<const PairImage>(std::move(image));
}

}  // namespace

std::optional<DepthGain> MeasureDepthGain(Database& database, const VerificationInput& input,
                                          const NamedVerifier& verifier, uint64_t seed,
                                          double budget_seconds) {
  const std::vector<image_pair_t> pairs = PairsWithDepth(database, seed);
  if (pairs.empty()) return std::nullopt;
  const StageLedger ledger(database, kStageVerification, input.options);
  Stage stage(NullMonitor(), kStageVerification);  // What cannot be read was named before.
  PairLoader loader(database.path(), input.min_num_matches, ledger, stage);
  loader.BeginDoneAgain(PairLoader::Priors::kKnown);
  const auto read_image = [&loader](image_t id) {
    return std::make_shared<const PairImage>(loader.LoadImage(id));
  };
  const std::vector<NamedVerifier> verifiers = {verifier};
  TaskVerifier worker(verifiers, seed);
  DepthGain gain{static_cast<int64_t>(pairs.size())};
  const Timer timer;
  for (const image_pair_t pair_id : pairs) {
    const bool is_enough = timer.Seconds() > kSampleShare * budget_seconds;
    if (gain.num_sampled == kMaxSampledPairs || (gain.num_sampled > 0 && is_enough)) break;
    PairTask task;
    task.pair_id = pair_id;
    if (!loader.LoadPair(task, read_image) || !task.image1) continue;
    if (gain.num_sampled == 0) worker.Run(task);  // the verifier takes its memory
    gain.seconds_with += worker.Run(task).runs[0].seconds;
    task.image1 = WithoutDepth(*task.image1);
    task.image2 = WithoutDepth(*task.image2);
    gain.seconds_without += worker.Run(task).runs[0].seconds;
    ++gain.num_sampled;
  }
  return gain.num_sampled > 0 ? std::optional(gain) : std::nullopt;
}

}  // namespace cairn
