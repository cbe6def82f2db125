#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "cairn/base/types.h"
#include "cairn/database/database.h"

namespace cairn {

// Which prior focal lengths (from EXIF, or given) verified pairs contradict. A wrong one shows in
// most pairs of its camera: the essential matrix explains clearly fewer of the matches that have
// votes of affine frames than a fundamental matrix does.

// Among the given pairs, those to collect evidence from: some of each camera that has a prior and
// no verdict yet, drawn by their ids. Ascending.
std::vector<image_pair_t> PairsToWeigh(const Database& database,
                                       const std::vector<image_pair_t>& pairs);

// Evidence of one pair of cameras.
struct CameraPairEvidence {
  camera_t camera_id1 = kInvalidCameraId;
  camera_t camera_id2 = kInvalidCameraId;
  bool is_contradicting = false;
};

// Whether the pair contradicts a prior focal length; never where too few matches are explained.
bool IsContradicting(const PairFocalEvidence& evidence);

// Judges every camera with enough pairs, by the first few of its pairs. The camera with the largest
// share of contradicting pairs is rejected first and its pairs with it, since they are no evidence
// about the other cameras.
std::map<camera_t, CameraFocal> JudgeFocals(std::vector<CameraPairEvidence> pairs);

struct LearnedFocals {
  std::set<camera_t> rejected;       // by this call alone
  std::vector<image_pair_t> undone;  // their pairs that had been verified; ascending
};
// Judges the cameras by the evidence in the database, and stores the verdicts. The results of pairs
// with a focal length that is rejected now are removed with their jobs, in the same transaction:
// these pairs count as not verified.
LearnedFocals LearnFocals(Database& database);

// One line a rejected prior, with one of the camera's images.
std::vector<std::string> RejectedFocalTexts(const Database& database,
                                            const std::set<camera_t>& cameras);

std::set<camera_t> RejectedCameras(const std::map<camera_t, CameraFocal>& focals);

}  // namespace cairn
