#include "global_sfm/pairs_csv.h"

#include <charconv>
#include <map>
#include <set>

#include "cairn/base/error.h"
#include "cairn/io/csv.h"
#include "cairn/mapper/view_edges.h"
#include "cairn/two_view/pair_verifier.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

using MetricsOfPairs = std::map<image_pair_t, std::vector<PairMetrics>>;

MetricsOfPairs ReadMetrics(const Database& database, const std::string& verifier) {
  MetricsOfPairs metrics;
  std::set<std::string> verifiers;
  for (PairMetrics& m : database.ReadPairMetrics()) {
    verifiers.insert(m.verifier);
    if (verifier.empty() || m.verifier == verifier) metrics[m.pair_id].push_back(std::move(m));
  }
  if (!verifier.empty() && !verifiers.contains(verifier)) {
    std::string known;
    for (const std::string& name : verifiers) known += (known.empty() ? "" : ", ") + name;
    throw ConfigError("pairs_verifier", "'" + verifier + "' was not run; the database has " +
                                            (known.empty() ? "no verifier's results" : known));
  }
  return metrics;
}

// Pairs with matches, and pairs whose inliers alone are in the database.
std::map<image_pair_t, int> ReadCandidates(const Database& database) {
  std::map<image_pair_t, int> candidates;
  for (const auto& [pair_id, n] : database.ReadNumMatches()) {
    if (n > 0) candidates[pair_id] = n;
  }
  for (const auto& [pair_id, n] : database.ReadNumInliers()) {
    if (n > 0) candidates.emplace(pair_id, n);
  }
  return candidates;
}

void Append(double value, std::string& text) {
  char digits[32];
  text.push_back(',');
  text.append(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
}

}  // namespace

std::vector<PairRow> ReadPairRows(const Database& database, const std::string& verifier) {
  std::map<image_t, std::string> names;
  for (const Image& image : database.ReadImages()) names[image.image_id] = image.name;
  const MetricsOfPairs metrics = ReadMetrics(database, verifier);
  std::map<image_pair_t, ViewEdge> edges;
  if (verifier.empty()) {
    for (ViewEdge& edge : ReadViewEdges(database)) edges[edge.PairId()] = std::move(edge);
  }
  std::vector<PairRow> rows;
  for (const auto& [pair_id, num_matches] : ReadCandidates(database)) {
    PairRow& row = rows.emplace_back();
    const auto [image_id1, image_id2] = PairIdToImagePair(pair_id);
    row.name1 = names[image_id1];
    row.name2 = names[image_id2];
    row.num_matches = num_matches;
    if (const auto edge = edges.find(pair_id); edge != edges.end()) {
      row.num_inliers = edge->second.num_inliers;
      if (edge->second.removal != EdgeRemoval::kNoPose) {
        row.cam2_from_cam1 = edge->second.cam2_from_cam1;
      }
    }
    const auto found = metrics.find(pair_id);
    if (found == metrics.end()) continue;
    for (const PairMetrics& m : found->second) {
      row.num_iterations += m.num_iterations;
      row.milliseconds +=
          1e3 * database.ReadTiming(kStageVerification, pair_id, m.verifier).value_or(0.0);
      if (verifier.empty() || m.status != PairStatusName(PairStatus::kVerified)) continue;
      row.num_inliers = m.num_inliers;
      row.cam2_from_cam1 = m.cam2_from_cam1;
    }
  }
  return rows;
}

std::string FormatPairsCsv(const std::vector<PairRow>& rows) {
  std::string text = "name1,name2,matches,inliers,iterations,ms,qw,qx,qy,qz,tx,ty,tz\n";
  for (const PairRow& row : rows) {
    text += CsvField(row.name1) + "," + CsvField(row.name2) + "," +
            std::to_string(row.num_matches) + "," + std::to_string(row.num_inliers) + "," +
            std::to_string(row.num_iterations);
    Append(row.milliseconds, text);
    if (row.cam2_from_cam1) {
      const auto& [q, t] = *row.cam2_from_cam1;
      for (const double v : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}) Append(v, text);
    } else {
      text += ",,,,,,,";
    }
    text += "\n";
  }
  return text;
}

}  // namespace cairn
