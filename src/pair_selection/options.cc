#include "cairn/pair_selection/options.h"

#include <algorithm>
#include <sstream>

#include "cairn/base/error.h"

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
  std::sort(ways.begin(), ways.end());
  ways.erase(std::unique(ways.begin(), ways.end()), ways.end());
  for (const PairWay way : {PairWay::kExhaustive, PairWay::kAuto}) {
    if (ways.size() == 1 || std::find(ways.begin(), ways.end(), way) == ways.end()) continue;
    throw ConfigError("pairs", "'" + std::string(NameOf(kPairWays, way)) +
                                   "' stands alone; sequential, spatial and retrieval combine");
  }
  return ways;
}

}  // namespace cairn
