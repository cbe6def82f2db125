#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "cairn/base/progress.h"
#include "cairn/database/database.h"
#include "database/own_matches.h"
#include "intrinsics/known_intrinsics.h"
#include "pipeline/pairs/feed.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {

// Reads what the verifiers need, in the reading thread of a PairFeed, with a connection of its own.
// A row that cannot be read is reported by one Warning; an image without readable keypoints or
// camera and a pair without readable matches are left out, an image without readable depth has
// none.
class PairLoader {
 public:
  // keeps_keypoints: those of all images that were ever read stay in memory, for later rounds.
  PairLoader(const std::string& database_path, int min_num_matches, bool keeps_keypoints,
             const StageLedger& ledger, ProgressMonitor& monitor);

  // From now on, pairs that are not done are read, with what is known of cameras now.
  void BeginRound();
  // From now on, pairs that are done are read again: with what is known of cameras now, or before
  // any prior focal length was rejected.
  enum class Priors { kKnown, kUnjudged };
  void BeginDoneAgain(Priors priors);

  PairImage LoadImage(image_t id);
  // False: the pair is none of these, or left out. Pairs with fewer than min_num_matches come
  // without images. Throws ConfigError if the pair was done from other inputs.
  bool LoadPair(PairTask& task, const std::function<PairFeed::ImagePtr(image_t)>& image);

  // To be read when the feed is at its end.
  const std::vector<std::string>& messages() const { return messages_; }
  double busy_seconds() const { return busy_seconds_; }

 private:
  struct HashedKeypoints {
    std::shared_ptr<const std::vector<Keypoint>> keypoints;
    uint64_t hash = 0;
  };

  void Report(const std::string& message);
  std::string Name(image_t id) const;
  void ReadImage(image_t id, PairImage& loaded);
  HashedKeypoints ReadKeypoints(image_t id);
  bool ReadPair(PairTask& task, const std::function<PairFeed::ImagePtr(image_t)>& image);
  // Throws IoError if a match refers to a keypoint that is not there.
  void CheckMatches(const PairTask& task) const;

  Database database_;
  const int min_num_matches_;
  const bool keeps_keypoints_;
  const StageLedger& ledger_;
  ProgressMonitor& monitor_;
  const OwnMatches own_matches_;
  std::map<camera_t, Camera> cameras_;
  std::map<image_t, Image> images_;
  std::map<camera_t, KnownIntrinsics> intrinsics_;
  bool reads_done_ = false;
  std::map<image_t, HashedKeypoints> kept_keypoints_;
  std::map<image_t, bool> is_damaged_;  // images that were looked at; reported once
  std::vector<std::string> messages_;
  double busy_seconds_ = 0;
};

}  // namespace cairn
