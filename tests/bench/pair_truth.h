#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cairn/geometry/rigid3d.h"

namespace cairn::bench {

// True camera poses by image name, of whatever ReadModel reads.
std::map<std::string, Rigid3d> ReadTruePoses(const std::string& path);

enum class PairKind { kTrue, kFalse, kUnknown };
// As tests of strecha_29 define it, where names are <scene>_<file>: images of one scene (the name
// up to the last '_') are a true pair, of different sites a false one; fountain, entry and castle
// are one site.
PairKind KindOfPair(const std::string& name1, const std::string& name2);

// What a verifier did with one pair.
struct PairResult {
  std::string name1, name2;
  PairKind kind = PairKind::kUnknown;
  std::optional<Rigid3d> cam2_from_cam1;  // absent: rejected
  int num_matches = 0;
  int num_inliers = 0;
  int64_t num_iterations = 0;
  double seconds = 0.0;
  std::string note;
  double error_deg = 180.0;  // pose error, filled by ScoreResults
};

struct Scores {
  int num_true = 0, num_false = 0, accepted_true = 0, accepted_false = 0;
  int num_wrong = 0;  // of the accepted true ones, poses that are off by more than 20 degrees
  double auc1 = 0, auc5 = 0, auc10 = 0, auc20 = 0;  // percent
  double median_ms_true = 0, median_ms_false = 0;
  double total_seconds = 0;  // true and false pairs
  double all_seconds = 0;    // and those of which the truth is not known
};

// The same measure as shared/tools/eval_pairs.py; a pair with fewer than `min_inliers` counts as
// rejected.
Scores ScoreResults(const std::map<std::string, Rigid3d>& truth, int min_inliers,
                    std::vector<PairResult>* results);

// One line of a table.
std::string FormatScores(const std::string& label, const Scores& scores);
std::string ScoresHeader();

// name1,name2,matches,inliers,iterations,ms,qw,qx,qy,qz,tx,ty,tz (then error_deg, note).
void WriteCsv(const std::string& path, const std::vector<PairResult>& results);

}  // namespace cairn::bench
