#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace cairn {

// A cost of every pair of n items: upper triangle, row by row.
class PairCosts {
 public:
  explicit PairCosts(size_t n) : n_(n), costs_(n * (n - 1) / 2) {}

  size_t NumItems() const { return n_; }
  size_t NumPairs() const { return costs_.size(); }
  float& operator[](size_t pair) { return costs_[pair]; }
  float operator[](size_t pair) const { return costs_[pair]; }
  // Index of the pair i != j.
  size_t Pair(size_t i, size_t j) const {
    if (i > j) std::swap(i, j);
    return i * (2 * n_ - i - 1) / 2 + (j - i - 1);
  }

 private:
  size_t n_;
  std::vector<float> costs_;
};

// The pairs of a minimum spanning tree and the cheapest others, num_chosen in all, as a flag a
// pair. num_chosen lies between n - 1 and the number of pairs.
std::vector<bool> ChoosePairs(const PairCosts& costs, size_t num_chosen);

// The same where only some pairs can be chosen: indices of candidates, sorted; all of them where
// there are fewer.
struct CandidatePair {
  int item1 = 0, item2 = 0;
  float cost = 0;
};
std::vector<size_t> ChoosePairs(size_t num_items, std::span<const CandidatePair> candidates,
                                size_t num_chosen);

}  // namespace cairn
