#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/database/database.h"

namespace cairn {

// A row of the table of pairs, for scoring by others.
struct PairRow {
  std::string name1, name2;  // image_id1 < image_id2
  int num_matches = 0;
  int num_inliers = 0;  // 0: rejected or not tried
  int64_t num_iterations = 0;
  double milliseconds = 0;  // the pair's whole verification
  std::optional<Rigid3d> cam2_from_cam1;
};

// One row for every two images with matches, in the order of the pair ids. `verifier` "": what
// became the pair's two-view geometry, hypotheses and time summed over all verifiers that were run;
// else what that verifier found. Throws ConfigError for a verifier that the database does not know,
// IoError.
std::vector<PairRow> ReadPairRows(const Database& database, const std::string& verifier);

// name1,name2,matches,inliers,iterations,ms,qw,qx,qy,qz,tx,ty,tz with a header line; the last seven
// are empty where no pose is known. Names with commas or quotes are quoted (RFC 4180).
std::string FormatPairsCsv(const std::vector<PairRow>& rows);

}  // namespace cairn
