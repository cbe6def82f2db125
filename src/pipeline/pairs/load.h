#pragma once

#include <functional>
#include <map>
#include <string>

#include "cairn/database/database.h"
#include "database/match_origins.h"
#include "intrinsics/known_intrinsics.h"
#include "pipeline/pairs/feed.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {

// Reads what the verifiers need, in the reading thread of a PairFeed, with a connection of its own.
// The stage is warned once of a row that cannot be read: an image without readable keypoints or
// camera and a pair without readable matches are left out, an image without readable depth has
// none.
class PairLoader {
 public:
  PairLoader(const std::string& database_path, int min_num_matches, const StageLedger& ledger,
             Stage& stage);

  // From now on, pairs that are not done are read, with what is known of cameras now.
  void BeginRound();
  // From now on, pairs that are done are read again, as before any prior focal length was rejected.
  void BeginDoneAgain();

  PairImage LoadImage(image_t id);
  // False: the pair is none of these, or left out. Pairs with fewer than min_num_matches come
  // without images. Throws ConfigError if the pair was done from other inputs.
  bool LoadPair(PairTask& task, const std::function<PairFeed::ImagePtr(image_t)>& image);

  // To be read when the feed is at its end. Why pairs were left out, except for those of images
  // that were.
  const std::map<image_pair_t, std::string>& left_out() const { return left_out_; }

 private:
  std::string Name(image_t id) const;
  void ReadImage(image_t id, PairImage& loaded);
  bool ReadPair(PairTask& task, const std::function<PairFeed::ImagePtr(image_t)>& image);
  // Throws IoError if a match refers to a keypoint that is not there.
  void CheckMatches(const PairTask& task) const;

  Database database_;
  const int min_num_matches_;
  const StageLedger& ledger_;
  Stage& stage_;
  const MatchOrigins origins_;
  std::map<camera_t, Camera> cameras_;
  std::map<image_t, Image> images_;
  std::map<camera_t, KnownIntrinsics> intrinsics_;
  bool reads_done_ = false;
  std::map<image_t, bool> is_damaged_;  // images that were looked at; reported once
  std::map<image_pair_t, std::string> left_out_;
};

}  // namespace cairn
