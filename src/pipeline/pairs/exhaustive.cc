#include "pipeline/pairs/exhaustive.h"

#include "database/own_matches.h"

namespace cairn {
namespace {

// Measured: 20 ms for 4096 x 4096 descriptors (build/bench/matching_bench, AVX-512 VNNI).
constexpr double kSecondsPerProduct = 0.020 / (4096.0 * 4096.0);
// Measured: verification of the collections of tests/bench takes 0.8 to 24 ms a pair; the median.
constexpr double kSecondsPerPair = 0.007;

// Sums over a set of images, from which those over its pairs follow.
struct FeatureSums {
  double images = 0, features = 0, squares = 0;
  void Add(double num) {
    images += 1;
    features += num;
    squares += num * num;
  }
  double Seconds() const {
    return 0.5 * (kSecondsPerProduct * (features * features - squares) +
                  kSecondsPerPair * images * (images - 1));
  }
};

}  // namespace

GivenImages::GivenImages(const Database& database, const StageLedger& ledger) : ledger_(ledger) {
  for (const auto& [pair, num] : database.ReadNumMatches()) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    // A pair of ours has records for both images.
    if (ledger.Find(id1) != nullptr && ledger.Find(id2) != nullptr) continue;
    unrecorded_.insert({id1, id2});
  }
}

bool GivenImages::Contains(image_t id) const {
  const JobRecord* job = ledger_.Find(id);
  return job != nullptr ? job->note == kGivenNote : unrecorded_.count(id) > 0;
}

bool GivenImages::DecidedAbout(image_pair_t pair) const {
  const auto [id1, id2] = PairIdToImagePair(pair);
  return Contains(id1) && Contains(id2);
}

std::vector<image_pair_t> ExhaustivePairs(const std::map<image_t, int>& num_descriptors,
                                          const GivenImages& given) {
  std::vector<image_pair_t> pairs;
  for (auto first = num_descriptors.begin(); first != num_descriptors.end(); ++first) {
    const bool first_is_given = given.Contains(first->first);
    for (auto second = std::next(first); second != num_descriptors.end(); ++second) {
      if (first_is_given && given.Contains(second->first)) continue;
      pairs.push_back(ImagePairToPairId(first->first, second->first));
    }
  }
  return pairs;
}

double ExhaustiveSeconds(const std::map<image_t, int>& num_descriptors, const GivenImages& given) {
  FeatureSums all, decided;
  for (const auto& [id, num] : num_descriptors) {
    all.Add(num);
    if (given.Contains(id)) decided.Add(num);
  }
  return all.Seconds() - decided.Seconds();
}

}  // namespace cairn
