#include "pipeline/depth_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "cairn/math/median.h"
#include "cairn/pipeline/pair_scheduler.h"

namespace cairn {
namespace {

constexpr int kMinPairs = 2;
constexpr int kMinSamples = 50;
constexpr double kMinShiftSigmas = 3.0;  // of the median over the pairs
constexpr int kMaxSweeps = 10;

// Right hypotheses of each pair, for one reading.
using Counts = std::vector<int>;

int64_t Sum(const Counts& counts) {
  return std::accumulate(counts.begin(), counts.end(), int64_t{0});
}

// Is the sum larger than another one by more than chance gives? By two standard deviations: of
// independent Poisson variables, or as the pairs differ, whichever is less.
bool IsClearlyMore(const Counts& counts, const Counts& others) {
  int64_t squared_differences = 0;
  for (size_t i = 0; i < counts.size(); ++i) {
    squared_differences += int64_t{counts[i] - others[i]} * (counts[i] - others[i]);
  }
  const int64_t sum = Sum(counts), other_sum = Sum(others);
  const auto variance = static_cast<double>(std::min(sum + other_sum, squared_differences));
  return static_cast<double>(sum - other_sum) > 2.0 * std::sqrt(variance);
}

// Of the readings from `first` on, the one with the most right hypotheses; a move from the present
// one must be worth it.
int BestScale(const std::vector<Counts>& readings, int first, int num_scales, int present) {
  int best = present;
  for (int k = first; k < first + num_scales; ++k) {
    if (Sum(readings[k]) > Sum(readings[best])) best = k;
  }
  return IsClearlyMore(readings[best], readings[present]) ? best : present;
}

// A shift that is sure need not show in the few pairs that teach, which see much the same: it is
// taken if it does no harm there. Shifted readings without counts are not to be had.
int BestReading(const std::vector<Counts>& readings, int present) {
  const int num_scales = static_cast<int>(readings.size()) / 2;
  const int plain = BestScale(readings, 0, num_scales, present % num_scales);
  if (readings[num_scales].empty()) return plain;
  const int shifted = BestScale(readings, num_scales, num_scales, plain + num_scales);
  return IsClearlyMore(readings[plain], readings[shifted]) ? plain : shifted;
}

// A pair, as one of its images sees it.
struct Half {
  const PairDepthEvidence* pair;
  bool is_first;
  image_t other;

  int num_readings() const {
    return is_first ? pair->evidence.num_readings1 : pair->evidence.num_readings2;
  }
  const DepthEvidence::Shift& shift() const {
    return is_first ? pair->evidence.shift1 : pair->evidence.shift2;
  }
  int NumRight(int reading, int other_reading) const {
    return is_first ? pair->evidence.NumRight(reading, other_reading)
                    : pair->evidence.NumRight(other_reading, reading);
  }
};

struct Node {
  std::vector<Half> halves;
  int num_readings = 0;
  int reading = 0;
  bool is_fixed = true;  // known before, or too little evidence
  double shift = 0.0;
  bool has_shift = false;

  int num_scales() const { return num_readings / 2; }
  bool MayRead(int k) const { return k < num_readings && (k < num_scales() || has_shift); }
};

class DepthChooser {
 public:
  DepthChooser(const std::map<image_pair_t, PairDepthEvidence>& evidence,
               const std::map<image_t, ImageDepth>& known) {
    for (const auto& [pair_id, pair] : evidence) {
      const auto [id1, id2] = PairIdToImagePair(pair_id);
      nodes_[id1].halves.push_back({&pair, true, id2});
      nodes_[id2].halves.push_back({&pair, false, id1});
    }
    for (auto& [id, node] : nodes_) Prepare(id, known, node);
  }

  void Choose() {
    MoveAllAlike();
    for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
      bool has_changed = false;
      for (auto& [id, node] : nodes_) has_changed |= MoveOne(node);
      if (!has_changed) break;
    }
  }

  std::map<image_t, ImageDepth> Result() const {
    std::map<image_t, ImageDepth> result;
    for (const auto& [id, node] : nodes_) {
      if (node.is_fixed) continue;
      ImageDepth& depth = result[id];
      depth.scale = node.reading % node.num_scales();
      if (node.reading >= node.num_scales()) depth.shift = node.shift;
      depth.num_right = Sum(CountRight(node, node.reading));
      for (const Half& half : node.halves) depth.num_hypotheses += half.pair->num_hypotheses;
    }
    return result;
  }

 private:
  static void Prepare(image_t id, const std::map<image_t, ImageDepth>& known, Node& node) {
    node.num_readings = node.halves[0].num_readings();
    int num_samples = 0;
    for (const Half& half : node.halves) num_samples += half.pair->evidence.num_samples;
    const auto given = known.find(id);
    if (given != known.end()) {
      const int scale = std::min(given->second.scale, node.num_scales() - 1);
      node.reading = given->second.shift == 0.0 ? scale : scale + node.num_scales();
      return;
    }
    node.is_fixed = std::ssize(node.halves) < kMinPairs || num_samples < kMinSamples;
    CombineShifts(node);
  }

  // The median over the pairs, weighted by how sure each is, if it is sure.
  static void CombineShifts(Node& node) {
    std::vector<std::pair<double, double>> values;  // value, weight
    std::vector<double> sigmas, deviations;
    double sum = 0.0;
    for (const Half& half : node.halves) {
      if (!std::isfinite(half.shift().sigma)) continue;
      values.emplace_back(half.shift().value, 1.0 / half.shift().sigma);
      sigmas.push_back(half.shift().sigma);
      sum += values.back().second;
    }
    if (std::ssize(values) < kMinPairs) return;
    std::sort(values.begin(), values.end());
    double below = 0.0;
    for (const auto& [value, weight] : values) {
      below += weight;
      node.shift = value;
      if (below >= 0.5 * sum) break;
    }
    for (const auto& [value, weight] : values) deviations.push_back(std::abs(value - node.shift));
    const double sigma = std::max(UpperMedian(sigmas), 1.4826 * UpperMedian(deviations)) /
                         std::sqrt(static_cast<double>(values.size()));
    node.has_shift = std::abs(node.shift) > kMinShiftSigmas * sigma;
  }

  // Of the image's pairs if it has this reading and the others keep theirs.
  Counts CountRight(const Node& node, int reading) const {
    Counts counts;
    for (const Half& half : node.halves) {
      counts.push_back(half.NumRight(reading, nodes_.at(half.other).reading));
    }
    return counts;
  }

  // All that may move take the reading that is best for all pairs alike.
  void MoveAllAlike() {
    int num_readings = std::numeric_limits<int>::max();
    for (const auto& [id, node] : nodes_) num_readings = std::min(num_readings, node.num_readings);
    std::vector<Counts> readings(num_readings);
    for (const auto& [id, node] : nodes_) {
      for (const Half& half : node.halves) {
        if (!half.is_first) continue;
        for (int k = 0; k < num_readings; ++k) readings[k].push_back(half.NumRight(k, k));
      }
    }
    const int plain = BestScale(readings, 0, num_readings / 2, 0);
    const int best = BestReading(readings, 0);
    for (auto& [id, node] : nodes_) {
      if (!node.is_fixed) node.reading = node.MayRead(best) ? best : plain;
    }
  }

  bool MoveOne(Node& node) const {
    if (node.is_fixed) return false;
    std::vector<Counts> readings;
    for (int k = 0; k < node.num_readings; ++k) {
      readings.push_back(node.MayRead(k) ? CountRight(node, k) : Counts());
    }
    const int best = BestReading(readings, node.reading);
    return std::exchange(node.reading, best) != best;
  }

  std::map<image_t, Node> nodes_;
};

}  // namespace

std::map<image_t, ImageDepth> ChooseDepth(const std::map<image_pair_t, PairDepthEvidence>& evidence,
                                          const std::map<image_t, ImageDepth>& known) {
  if (evidence.empty()) return {};
  DepthChooser chooser(evidence, known);
  chooser.Choose();
  return chooser.Result();
}

double DepthTrust(const ImageDepth& depth) {
  return static_cast<double>(depth.num_right + 1) / static_cast<double>(depth.num_hypotheses + 1);
}

std::string LearnedDepthText(const std::map<image_t, ImageDepth>& learned) {
  std::map<int, int> num_at_scale;
  int num_shifted = 0, num_useless = 0;
  for (const auto& [id, depth] : learned) {
    ++num_at_scale[depth.scale];
    num_shifted += depth.shift != 0.0;
    // Not half a right hypothesis among the 256 of a pair at most: 1AC+D is left out.
    num_useless += DepthTrust(depth) * 256 < 0.5;
  }
  std::string text = std::to_string(learned.size()) + " images";
  for (const auto& [scale, num] : num_at_scale) {
    text += ", " + std::to_string(num) + " at scale " + std::to_string(scale + 1);
  }
  return text + ", " + std::to_string(num_shifted) + " with a shift of the inverse depth, " +
         std::to_string(num_useless) + " useless";
}

}  // namespace cairn
