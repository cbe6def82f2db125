#include "cairn/pair_selection/options.h"

#include <algorithm>
#include <sstream>
#include <utility>

#include "cairn/base/error.h"
#include "math/sorted_order.h"

namespace cairn {

std::vector<PairWay> ParsePairWays(const std::string& text) {
  std::vector<std::string> names;
  for (const auto& entry : kPairWays) names.emplace_back(entry.name);
  std::vector<PairWay> ways;
  std::istringstream parts(text + ',');
  for (std::string name; std::getline(parts, name, ',');) {
    CheckChoice("pairs", name, names);
    ways.push_back(*ValueOf(kPairWays, name));
  }
  ways = Unique(std::move(ways));
  for (const PairWay way : {PairWay::kExhaustive, PairWay::kAuto}) {
    if (ways.size() == 1 || std::find(ways.begin(), ways.end(), way) == ways.end()) continue;
    throw ConfigError("pairs", "'" + std::string(NameOf(kPairWays, way)) +
                                   "' stands alone; sequential, spatial and retrieval combine");
  }
  return ways;
}

}  // namespace cairn
