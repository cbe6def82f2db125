#include "intrinsics/lens_learning.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <span>
#include <tuple>

#include "base/text.h"
#include "cairn/base/error.h"
#include "cairn/intrinsics/focal_calibration.h"
#include "cairn/math/median.h"
#include "intrinsics/camera_pairs.h"
#include "intrinsics/distortion_calibration.h"
#include "intrinsics/known_intrinsics.h"
#include "intrinsics/shared_lenses.h"

namespace cairn {
namespace {

constexpr int kMaxLensPairs = 100;          // of a camera
constexpr size_t kMaxMatches = 300;         // of a pair
constexpr size_t kMaxPairsTogether = 1000;  // that tell one focal length of many cameras
// A focal length as precise as that is taken, like EXIF's, which is no more precise; where the
// camera's pairs contradict it, it is rejected like EXIF's (focal_learning.h).
constexpr double kKnownSigma = 0.05;

struct LensPair {
  image_t image_id1, image_id2;
  FeatureMatches matches;
  std::vector<char> is_inlier;  // of each match
  DistortionPair pair;
};

// What is known of the cameras, and of which it is to be learned.
struct Lenses {
  std::map<camera_t, Camera> cameras;  // by what was learned before
  std::map<image_t, camera_t> camera_of;
  std::map<camera_t, int> num_pairs;  // likely ones
  std::set<camera_t> open;
  std::set<camera_t> trusted;  // whose focal lengths are known
};

Lenses ReadLenses(const Database& database, const std::vector<image_pair_t>& likely) {
  Lenses lenses;
  const std::map<camera_t, KnownIntrinsics> known = ReadKnownIntrinsics(database);
  for (const auto& [id, intrinsics] : known) {
    lenses.cameras[id] = intrinsics.camera;
    if (intrinsics.IsFocalTrusted() || intrinsics.IsConstant()) lenses.trusted.insert(id);
  }
  lenses.camera_of = CamerasOfImages(database);
  std::erase_if(lenses.camera_of,
                [&](const auto& entry) { return lenses.cameras.count(entry.second) == 0; });
  for (const image_pair_t pair : likely) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    std::set<camera_t> cameras;
    for (const image_t id : {id1, id2}) {
      if (lenses.camera_of.count(id) > 0) cameras.insert(lenses.camera_of.at(id));
    }
    for (const camera_t id : cameras) ++lenses.num_pairs[id];
  }
  for (const auto& [id, num_pairs] : lenses.num_pairs) {
    const KnownIntrinsics& intrinsics = known.at(id);
    const Camera& camera = intrinsics.camera;
    if (intrinsics.is_given || LooksMeasured(camera) || !camera.Validate().empty()) continue;
    // (More pairs may determine what fewer could not.)
    const bool is_known =
        intrinsics.HasLearned() || (intrinsics.lens && intrinsics.lens->num_pairs == num_pairs);
    if (is_known) continue;
    if (!camera.IsPlanar()) continue;  // (wide_focals.h)
    if (camera.has_prior_focal_length && !CanCalibrateDistortion(camera)) continue;
    lenses.open.insert(id);
  }
  return lenses;
}

std::vector<LensPair> ReadLensPairs(const Database& database, const Lenses& lenses,
                                    const std::vector<image_pair_t>& pairs) {
  std::vector<LensPair> lens_pairs;
  for (const image_pair_t pair : pairs) {
    LensPair lens_pair;
    std::tie(lens_pair.image_id1, lens_pair.image_id2) = PairIdToImagePair(pair);
    lens_pair.pair.camera_id1 = lenses.camera_of.at(lens_pair.image_id1);
    lens_pair.pair.camera_id2 = lenses.camera_of.at(lens_pair.image_id2);
    // Pixels of wide lenses have no fundamental matrix.
    if (!lenses.cameras.at(lens_pair.pair.camera_id1).IsPlanar() ||
        !lenses.cameras.at(lens_pair.pair.camera_id2).IsPlanar()) {
      continue;
    }
    try {
      const auto geometry = database.ReadTwoViewGeometry(pair);
      const auto matches = database.ReadMatches(pair);
      if (!geometry || !matches || geometry->inlier_matches.empty()) continue;
      const auto F = EssentialOf(*geometry, lenses.cameras.at(lens_pair.pair.camera_id1),
                                 lenses.cameras.at(lens_pair.pair.camera_id2));
      if (!F) continue;
      lens_pair.pair.F = *F;
      lens_pair.pair.tells_focal = geometry->config == TwoViewConfig::kCalibrated ||
                                   geometry->config == TwoViewConfig::kUncalibrated;
      const std::set<FeatureMatch> inliers(geometry->inlier_matches.begin(),
                                           geometry->inlier_matches.end());
      const size_t step = 1 + matches->size() / kMaxMatches;
      for (size_t i = 0; i < matches->size(); i += step) {
        lens_pair.matches.push_back((*matches)[i]);
        lens_pair.is_inlier.push_back(inliers.count((*matches)[i]) > 0);
      }
      lens_pairs.push_back(std::move(lens_pair));
    } catch (const IoError&) {  // The verification of the pair has reported it.
    }
  }
  return lens_pairs;
}

// The positions of the matches, image by image.
void ReadPixels(const Database& database, std::vector<LensPair>& lens_pairs) {
  std::map<image_t, std::vector<std::pair<size_t, int>>> sides;
  for (size_t i = 0; i < lens_pairs.size(); ++i) {
    sides[lens_pairs[i].image_id1].emplace_back(i, 1);
    sides[lens_pairs[i].image_id2].emplace_back(i, 2);
  }
  for (const auto& [id, uses] : sides) {
    std::vector<Keypoint> keypoints;
    try {
      keypoints = database.ReadKeypoints(id).value_or(std::vector<Keypoint>());
    } catch (const IoError&) {  // Its pairs are left out.
    }
    for (const auto& [i, side] : uses) {
      std::vector<Eigen::Vector2d>& pixels =
          side == 1 ? lens_pairs[i].pair.pixels1 : lens_pairs[i].pair.pixels2;
      for (const FeatureMatch& match : lens_pairs[i].matches) {
        const point2D_t point = side == 1 ? match.point1 : match.point2;
        if (point >= keypoints.size()) break;
        pixels.push_back(keypoints[point].Position());
      }
    }
  }
  std::erase_if(lens_pairs, [](const LensPair& lens_pair) {
    return lens_pair.pair.pixels1.size() != lens_pair.matches.size() ||
           lens_pair.pair.pixels2.size() != lens_pair.matches.size();
  });
}

// Leaves out matches that stay still in the picture, which any lens fits: of a frame around it, or
// of a background that does not turn with the object; and pairs most of whose inliers do.
void LeaveOutStill(const Lenses& lenses, std::vector<LensPair>& lens_pairs) {
  std::erase_if(lens_pairs, [&](LensPair& lens_pair) {
    DistortionPair& pair = lens_pair.pair;
    const double max_error_px =
        DefaultMaxErrorPx(lenses.cameras.at(pair.camera_id1), lenses.cameras.at(pair.camera_id2));
    size_t num_moving = 0;
    int inliers_that_move = 0;  // less those that do not
    for (size_t i = 0; i < pair.pixels1.size(); ++i) {
      const bool moves = (pair.pixels1[i] - pair.pixels2[i]).norm() > max_error_px;
      if (lens_pair.is_inlier[i]) inliers_that_move += moves ? 1 : -1;
      if (!moves) continue;
      pair.pixels1[num_moving] = pair.pixels1[i];
      pair.pixels2[num_moving++] = pair.pixels2[i];
    }
    pair.pixels1.resize(num_moving);
    pair.pixels2.resize(num_moving);
    return inliers_that_move <= 0;
  });
}

using Focals = std::map<camera_t, CalibratedFocal>;

bool IsKnown(const CalibratedFocal& focal) {
  return focal.status == FocalStatus::kCalibrated && focal.sigma <= kKnownSigma;
}

// The focal lengths that cameras which share a lens have together, by the camera that stands for
// them. (Photographs that are turned against its own have another center, and tell by themselves.)
Focals CalibrateTogether(const Lenses& lenses, const SharedLenses& shared,
                         std::span<const FocalPair> pairs, const RunContext& run) {
  const size_t step = 1 + pairs.size() / kMaxPairsTogether;
  std::vector<FocalPair> together;
  for (size_t i = 0; i < pairs.size(); i += step) {
    together.push_back(pairs[i]);
    for (camera_t* id : {&together.back().camera_id1, &together.back().camera_id2}) {
      const auto lens = shared.find(*id);
      if (lens == shared.end()) continue;
      const bool is_turned = lenses.cameras.at(*id).width != lenses.cameras.at(lens->second).width;
      if (!is_turned) *id = lens->second;
    }
  }
  return CalibrateFocals(lenses.cameras, lenses.trusted, together, {}, run).cameras;
}

// By how much the focal lengths of cameras of one lens differ, as a standard deviation of their
// logarithms: of those that are known by themselves.
double SpreadOf(const Focals& own, const SharedLenses& shared, camera_t lens) {
  std::vector<double> logs;
  for (const auto& [id, focal] : own) {
    const auto found = shared.find(id);
    if (found == shared.end() || found->second != lens || !IsKnown(focal)) continue;
    logs.push_back(std::log(focal.focal_px));
  }
  if (logs.empty()) return 0;
  const double median = UpperMedian(logs);
  for (double& each : logs) each = std::abs(each - median);
  return UpperMedian(logs) / kNormalMedian;
}

// The focal lengths of cameras that are only guessed; those that told nothing before stay unknown.
// Cameras that share a lens have one focal length, where that is known as precisely for each.
Focals LearnGuessedFocals(const Lenses& lenses, const SharedLenses& shared,
                          const std::vector<FocalPair>& pairs, const RunContext& run) {
  Focals focals = CalibrateFocals(lenses.cameras, lenses.trusted, pairs, {}, run).cameras;
  if (shared.empty()) return focals;
  Focals together = CalibrateTogether(lenses, shared, pairs, run);
  for (auto& [id, focal] : together) {
    focal.sigma = std::hypot(focal.sigma, SpreadOf(focals, shared, id));
  }
  for (const auto& [id, lens] : shared) {
    const auto found = together.find(lens);
    if (found == together.end() || !IsKnown(found->second)) continue;
    const CalibratedFocal& focal = found->second;
    // (Where there are two lenses, fewer pairs agree.)
    if (3 * focal.num_agreeing >= 2 * focal.num_pairs) focals[id] = focal;
  }
  return focals;
}

CameraLens MakeLens(const Camera& camera, const CalibratedDistortion* distortion,
                    const CalibratedFocal* focal) {
  CameraLens lens;
  double factor = 1.0;
  if (focal != nullptr && IsKnown(*focal)) {
    lens.focal_px = focal->focal_px;
    lens.focal_sigma = focal->sigma;
    lens.is_focal_known = true;
    factor = std::pow(focal->focal_px / camera.MeanFocal(), 2);
  }
  if (distortion != nullptr && distortion->is_significant) {
    lens.k = factor * distortion->k;
    lens.k_sigma = factor * distortion->sigma;
  }
  return lens;
}

std::string Describe(camera_t id, const CameraLens& lens) {
  std::string text = "camera " + std::to_string(id) + ": learned";
  if (lens.focal_px > 0) {
    text +=
        Formatted(" focal length %.1f px (sigma %.1f %%)", lens.focal_px, 100 * lens.focal_sigma);
  }
  if (lens.k != 0) {
    text += Formatted("%s k %.4f (sigma %.4f)", lens.focal_px > 0 ? "," : "", lens.k, lens.k_sigma);
  }
  return text;
}

template <class Value>
const Value* FindOrNull(const std::map<uint32_t, Value>& values, uint32_t id) {
  const auto it = values.find(id);
  return it == values.end() ? nullptr : &it->second;
}

// Stores the lenses and removes what was found without them.
std::vector<image_pair_t> Store(Database& database, const Lenses& known,
                                const std::map<camera_t, CameraLens>& lenses) {
  std::set<camera_t> changed;
  Database::Transaction transaction(database);
  for (const auto& [id, lens] : lenses) {
    database.WriteCameraLens(id, lens);
    if (!lens.IsEmpty()) changed.insert(id);
  }
  const std::vector<image_pair_t> undone = UndoVerification(database, known.camera_of, changed);
  for (const PairFocalEvidence& evidence : database.ReadFocalEvidence()) {
    if (IsOfCameras(evidence.pair_id, known.camera_of, changed)) {
      database.DeleteFocalEvidence(evidence.pair_id);
    }
  }
  transaction.Commit();
  return undone;
}

}  // namespace

LearnedLenses LearnLenses(Database& database, const std::vector<image_pair_t>& likely,
                          const RunContext& run) {
  LearnedLenses learned;
  const Lenses known = ReadLenses(database, likely);
  if (known.open.empty()) return learned;
  std::vector<LensPair> lens_pairs =
      ReadLensPairs(database, known, DrawPairs(likely, known.camera_of, known.open, kMaxLensPairs));
  ReadPixels(database, lens_pairs);
  LeaveOutStill(known, lens_pairs);
  std::vector<DistortionPair> pairs;
  for (LensPair& lens_pair : lens_pairs) pairs.push_back(std::move(lens_pair.pair));
  std::set<camera_t> constant;
  for (const auto& [id, camera] : known.cameras) {
    if (known.open.count(id) == 0) constant.insert(id);
  }
  SharedLenses shared = FindSharedLenses(database);
  std::erase_if(shared, [&](const auto& entry) { return known.open.count(entry.first) == 0; });
  const DistortionCalibrationReport report =
      CalibrateDistortion(known.cameras, constant, shared, pairs, run);
  const Focals focals = LearnGuessedFocals(known, shared, report.pairs, run);
  std::map<camera_t, CameraLens> lenses;
  for (const camera_t id : known.open) {
    CameraLens& lens = lenses[id];
    lens = MakeLens(known.cameras.at(id), FindOrNull(report.cameras, id), FindOrNull(focals, id));
    lens.num_pairs = known.num_pairs.at(id);
    if (!lens.IsEmpty()) learned.texts.push_back(Describe(id, lens));
  }
  learned.undone = Store(database, known, lenses);
  AdoptLenses(database);
  return learned;
}

}  // namespace cairn
