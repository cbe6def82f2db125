#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "cairn/base/types.h"
#include "cairn/database/database.h"

namespace cairn {

// What verified pairs say about trusted focal lengths (EXIF's, or given ones). A wrong one shows in
// most pairs of its camera: the essential matrix explains clearly fewer of the matches that affine
// frames bear out than a fundamental matrix does, which is no matter of chance or of one odd pair.

// Of the given pairs of cameras that are trusted and about which nothing is known yet, those to ask
// for evidence: some for each camera, drawn by their ids. Ascending.
std::vector<image_pair_t> PairsToWeigh(const Database& database,
                                       const std::vector<image_pair_t>& pairs);

// Evidence of one pair of cameras.
struct CameraPairEvidence {
  camera_t camera_id1 = kInvalidCameraId;
  camera_t camera_id2 = kInvalidCameraId;
  bool is_refuting = false;
};

// Does the pair refute a focal length? Nothing is said where too few matches are explained.
bool IsRefuting(const PairFocalEvidence& evidence);

// Judges every camera with enough pairs, by the first few of its pairs. The one that the largest
// share of its pairs refutes goes first, and its pairs with it: they say nothing about the other
// cameras.
std::map<camera_t, CameraFocal> JudgeFocals(std::vector<CameraPairEvidence> pairs);

struct LearnedFocals {
  std::set<camera_t> refuted;        // now; those of earlier runs are not among them
  std::vector<image_pair_t> undone;  // their pairs that had been verified; ascending
};
// Judges the cameras by what is in the database, and stores it. What was found with a focal length
// that is refuted now is removed with its jobs, in the same transaction: these pairs have not been
// verified.
LearnedFocals LearnFocals(Database& database);

// One line a refuted camera, with one of its images.
std::vector<std::string> RefutedFocalTexts(const Database& database,
                                           const std::set<camera_t>& cameras);

std::set<camera_t> RefutedCameras(const std::map<camera_t, CameraFocal>& focals);

}  // namespace cairn
