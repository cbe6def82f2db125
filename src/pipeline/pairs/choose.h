#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/database/database.h"
#include "cairn/pair_selection/pair_selection.h"
#include "cairn/report/run_report.h"
#include "database/match_origins.h"
#include "pipeline/pairs/photo_facts.h"
#include "report/stage.h"

namespace cairn {

// How the pairs of a run are chosen.
struct PairChoosing {
  std::string ways = "auto";  // --pairs
  PairSelectionOptions options = {};
  std::string image_path = {};  // for EXIF; "": none
  std::string gps_path = {};    // positions, instead of EXIF's
};

// What the stage "pairs" depends on, as lines "key = value".
std::string PairStageOptions(const PairChoosing& choosing);

// Throws ConfigError for a way that needs times or positions that the photographs lack, where there
// are images whose pairs are to be chosen: before features are extracted, not after.
void CheckPairWays(const Database& database, const PairChoosing& choosing, const RunContext& run);

// Chooses the pairs that are matched, in rounds, and writes each with its reason into the database,
// where a later run finds them: first of images that were not looked at with these options (all of
// a new database, the new ones of one that is continued); then, after these are verified, what the
// view graph proposes. What is chosen depends on the database, the photographs' EXIF and the
// options alone.
class PairChooser {
 public:
  PairChooser(Database& database, const PairChoosing& choosing, const RunContext& run);

  // The first round. Throws ConfigError for a way that the photographs do not allow.
  StageReport ChooseFirst();
  // Proposals of the view graph, to be matched; ascending. None: there are no more.
  std::vector<image_pair_t> ChooseNext();
  // Pairs chosen so far; ascending.
  std::vector<image_pair_t> Chosen() const;

 private:
  using Choices = std::map<image_pair_t, PairReason>;

  bool IsExhaustive() const { return ways_.front() == PairWay::kExhaustive; }
  bool Uses(PairWay way) const;
  // Candidates among the images, `num` for each that asks; none without retrieval.
  Candidates Find(const Queries& queries, int num);
  const Candidates& FirstCandidates();
  void AddSequential(const PhotoFacts& facts, Stage& stage, Choices& choices);
  void AddSpatial(const PhotoFacts& facts, Stage& stage, Choices& choices);
  Choices FirstChoices(Stage& stage);
  Choices NextChoices(const std::vector<PairChoiceRecord>& records);
  // Writes those that are new, and returns them; ascending.
  std::vector<image_pair_t> Write(const Choices& choices, int round);
  void WriteStage(bool is_complete);

  Database& database_;
  const PairChoosing choosing_;
  const RunContext& run_;
  const MatchOrigins origins_;
  const std::vector<Image> images_;
  std::map<image_t, int> num_descriptors_;
  bool is_auto_ = false;
  std::vector<PairWay> ways_;
  std::optional<DescribedImages> described_;
  std::optional<Candidates> first_candidates_;
};

}  // namespace cairn
