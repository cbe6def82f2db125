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

// Among the given pairs, those to collect evidence from: some of each camera that has a prior,
// rejected or not, drawn by their ids. Ascending.
std::vector<image_pair_t> PairsToWeigh(const Database& database,
                                       const std::vector<image_pair_t>& pairs);

// Those of the pairs (ascending) of which the database has no evidence.
std::vector<image_pair_t> WithoutEvidence(const Database& database,
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
  std::set<camera_t> rejected;       // that were not before
  std::set<camera_t> restored;       // that were rejected before
  std::vector<image_pair_t> undone;  // the pairs of both that had been verified; ascending
};
// Judges the cameras by the evidence of these pairs (ascending) alone, whatever was found before,
// so that the verdicts are those of a new database with the same photographs, and stores them. The
// results of the pairs of cameras with another verdict than before are removed with their jobs, in
// the same transaction: these pairs count as not verified.
LearnedFocals LearnFocals(Database& database, const std::vector<image_pair_t>& pairs);

// One line a rejected prior, with one of the camera's images.
std::vector<std::string> RejectedFocalTexts(const Database& database,
                                            const std::set<camera_t>& cameras);

std::set<camera_t> RejectedCameras(const std::map<camera_t, CameraFocal>& focals);

}  // namespace cairn
