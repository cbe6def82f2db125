#include "intrinsics/focal_learning.h"

#include <algorithm>
#include <iterator>

#include "base/text.h"
#include "intrinsics/camera_pairs.h"
#include "intrinsics/known_intrinsics.h"

namespace cairn {
namespace {

// Of likely pairs of photographs with right focal lengths, 14 of 518 explain less than this share
// of what F explains; with one that is half or twice the right one, 349 of 385.
constexpr double kMinShare = 0.95;
constexpr int kMinExplained = 40;
constexpr int kMaxFocalPairs = 8;     // of a camera
constexpr int kMinContradicting = 3;  // pairs

struct Tally {
  int num_pairs = 0;
  int num_contradicting = 0;
  bool IsRejected() const {
    return num_contradicting >= kMinContradicting && 2 * num_contradicting >= num_pairs;
  }
};

// Of each camera's pairs the first ones that were drawn. (Those beyond were drawn for the sake of
// the other camera.)
std::map<camera_t, Tally> Count(const std::vector<CameraPairEvidence>& pairs) {
  std::map<camera_t, Tally> tallies;
  for (const CameraPairEvidence& pair : pairs) {
    for (const camera_t id : std::set<camera_t>{pair.camera_id1, pair.camera_id2}) {
      Tally& tally = tallies[id];
      if (tally.num_pairs == kMaxFocalPairs) continue;
      ++tally.num_pairs;
      tally.num_contradicting += pair.is_contradicting;
    }
  }
  return tallies;
}

// The rejected camera with the largest share of contradicting pairs, of equal ones with the most,
// of equal ones the first.
camera_t FindWorst(const std::map<camera_t, Tally>& tallies) {
  camera_t worst = kInvalidCameraId;
  for (const auto& [id, tally] : tallies) {
    if (!tally.IsRejected()) continue;
    if (worst == kInvalidCameraId) {
      worst = id;
      continue;
    }
    const Tally& best = tallies.at(worst);
    const int64_t share = int64_t{tally.num_contradicting} * best.num_pairs;
    const int64_t best_share = int64_t{best.num_contradicting} * tally.num_pairs;
    if (share > best_share ||
        (share == best_share && tally.num_contradicting > best.num_contradicting)) {
      worst = id;
    }
  }
  return worst;
}

struct DrawnEvidence {
  std::vector<PairFocalEvidence> drawn;  // in the order in which they were drawn
  std::vector<PairFocalEvidence> stale;  // of pairs that are not drawn today
};

DrawnEvidence ReadEvidence(const Database& database, const std::vector<image_pair_t>& pairs) {
  DrawnEvidence evidence;
  for (const PairFocalEvidence& pair : database.ReadFocalEvidence()) {
    const bool is_drawn = std::binary_search(pairs.begin(), pairs.end(), pair.pair_id);
    (is_drawn ? evidence.drawn : evidence.stale).push_back(pair);
  }
  std::sort(evidence.drawn.begin(), evidence.drawn.end(),
            [](const PairFocalEvidence& a, const PairFocalEvidence& b) {
              return DrawingOrder(a.pair_id) < DrawingOrder(b.pair_id);
            });
  return evidence;
}

std::set<camera_t> Difference(const std::set<camera_t>& a, const std::set<camera_t>& b) {
  std::set<camera_t> difference;
  std::set_difference(a.begin(), a.end(), b.begin(), b.end(),
                      std::inserter(difference, difference.end()));
  return difference;
}

}  // namespace

std::vector<image_pair_t> PairsToWeigh(const Database& database,
                                       const std::vector<image_pair_t>& pairs) {
  const std::map<image_t, camera_t> camera_of = CamerasOfImages(database);
  std::set<camera_t> with_prior;
  for (const auto& [id, known] : ReadKnownIntrinsics(database)) {
    if (known.HasPriorFocal()) with_prior.insert(id);
  }
  std::vector<image_pair_t> candidates;
  for (const image_pair_t pair : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    const auto camera1 = camera_of.find(id1), camera2 = camera_of.find(id2);
    if (camera1 == camera_of.end() || camera2 == camera_of.end()) continue;
    if (with_prior.count(camera1->second) > 0 && with_prior.count(camera2->second) > 0) {
      candidates.push_back(pair);
    }
  }
  return DrawPairs(std::move(candidates), camera_of, with_prior, kMaxFocalPairs);
}

std::vector<image_pair_t> WithoutEvidence(const Database& database,
                                          const std::vector<image_pair_t>& pairs) {
  std::vector<image_pair_t> known, missing;
  for (const PairFocalEvidence& evidence : database.ReadFocalEvidence()) {
    known.push_back(evidence.pair_id);
  }
  std::set_difference(pairs.begin(), pairs.end(), known.begin(), known.end(),
                      std::back_inserter(missing));
  return missing;
}

bool IsContradicting(const PairFocalEvidence& evidence) {
  return evidence.num_by_fundamental >= kMinExplained &&
         evidence.num_by_essential < kMinShare * evidence.num_by_fundamental;
}

std::map<camera_t, CameraFocal> JudgeFocals(std::vector<CameraPairEvidence> pairs) {
  std::map<camera_t, CameraFocal> judged;
  const std::map<camera_t, Tally> all = Count(pairs);
  std::map<camera_t, Tally> tallies = all;
  for (camera_t worst = FindWorst(tallies); worst != kInvalidCameraId; worst = FindWorst(tallies)) {
    judged[worst] = {true, tallies[worst].num_pairs, tallies[worst].num_contradicting};
    std::erase_if(pairs, [worst](const CameraPairEvidence& pair) {
      return pair.camera_id1 == worst || pair.camera_id2 == worst;
    });
    tallies = Count(pairs);
  }
  for (const auto& [id, tally] : all) {
    if (judged.count(id) > 0) continue;
    const Tally& rest = tallies[id];
    // Where all are wrong, few pairs are left of the last ones, and none that support them.
    const bool is_rejected = tally.IsRejected() && 2 * rest.num_contradicting >= rest.num_pairs;
    if (is_rejected || rest.num_pairs >= kMinContradicting) {
      const Tally& shown = is_rejected ? tally : rest;
      judged[id] = {is_rejected, shown.num_pairs, shown.num_contradicting};
    }
  }
  return judged;
}

LearnedFocals LearnFocals(Database& database, const std::vector<image_pair_t>& pairs) {
  const std::map<image_t, camera_t> camera_of = CamerasOfImages(database);
  const auto [evidence, stale] = ReadEvidence(database, pairs);
  std::vector<CameraPairEvidence> camera_pairs;
  for (const PairFocalEvidence& pair : evidence) {
    if (pair.num_by_fundamental < kMinExplained) continue;
    const auto [id1, id2] = PairIdToImagePair(pair.pair_id);
    camera_pairs.push_back({camera_of.at(id1), camera_of.at(id2), IsContradicting(pair)});
  }
  const std::map<camera_t, CameraFocal> judged = JudgeFocals(std::move(camera_pairs));
  const std::map<camera_t, CameraFocal> before = database.ReadCameraFocals();
  LearnedFocals learned;
  if (judged == before && stale.empty()) return learned;
  const std::set<camera_t> is_rejected = RejectedCameras(judged);
  const std::set<camera_t> was_rejected = RejectedCameras(before);
  learned.rejected = Difference(is_rejected, was_rejected);
  learned.restored = Difference(was_rejected, is_rejected);
  std::set<camera_t> changed = learned.rejected;
  changed.insert(learned.restored.begin(), learned.restored.end());
  Database::Transaction transaction(database);
  for (const PairFocalEvidence& pair : stale) database.DeleteFocalEvidence(pair.pair_id);
  database.WriteCameraFocals(judged);
  learned.undone = UndoVerification(database, camera_of, changed);
  transaction.Commit();
  return learned;
}

std::set<camera_t> RejectedCameras(const std::map<camera_t, CameraFocal>& focals) {
  std::set<camera_t> rejected;
  for (const auto& [id, focal] : focals) {
    if (focal.is_rejected) rejected.insert(id);
  }
  return rejected;
}

std::vector<std::string> RejectedFocalTexts(const Database& database,
                                            const std::set<camera_t>& cameras) {
  std::map<camera_t, std::pair<std::string, int>> images;  // the first one's name, and how many
  for (const Image& image : database.ReadImages()) {
    auto& [name, count] = images[image.camera_id];
    if (count++ == 0) name = image.name;
  }
  std::vector<std::string> texts;
  for (const auto& [id, known] : ReadKnownIntrinsics(database)) {
    if (cameras.count(id) == 0) continue;
    const auto& [name, count] = images[id];
    texts.push_back(
        "camera " + std::to_string(id) + " (" + name +
        (count > 1 ? " and " + std::to_string(count - 1) + " more" : "") + "): " +
        Formatted("%s focal length %.1f px rejected: in %d of %d pairs a fundamental matrix "
                  "explains far more matches; its pairs are verified without it",
                  known.camera.has_prior_focal_length ? "prior" : "learned",
                  known.camera.MeanFocal(), known.judgement->num_contradicting,
                  known.judgement->num_pairs));
  }
  return texts;
}

}  // namespace cairn
