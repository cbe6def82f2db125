#include "intrinsics/wide_focals.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/text.h"
#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/two_view/pair_verifier.h"
#include "database/match_origins.h"
#include "intrinsics/camera_pairs.h"
#include "intrinsics/known_intrinsics.h"
#include "intrinsics/shared_lenses.h"

namespace cairn {
namespace {

// Pairs that a camera is judged by, of so many times as many with the most matches: those with the
// very most are often of neighbors that hardly moved, whose support hardly depends on it.
constexpr int kMaxWidePairs = 16;
constexpr int kSpread = 4;
// Factors of the guess, two to a power: fisheye lenses fill frames from a circle in the shorter
// side to 100 degrees in the longer one.
constexpr double kReach = 1.5, kCoarseStep = 0.25, kFineStep = 0.0625;

struct WidePair {
  image_pair_t pair_id = 0;
  const Camera* camera1 = nullptr;
  const Camera* camera2 = nullptr;
  std::vector<Keypoint> keypoints1, keypoints2;
  FeatureMatches matches;
  bool are_best_first = false;
};

class WideFocalFinder {
 public:
  WideFocalFinder(Database& database, const TwoViewOptions& options, const RunContext& run)
      : database_(database),
        options_(options),
        run_(run),
        known_(ReadKnownIntrinsics(database)),
        camera_of_(CamerasOfImages(database)) {
    for (const auto& [id, known] : known_) {
      cameras_[id] = known.camera;
      lens_of_[id] = id;
    }
  }

  std::vector<std::string> Run() {
    std::map<camera_t, std::vector<camera_t>> open;  // by the camera that stands for the lens
    for (const auto& [id, lens] : FindSharedLenses(database_)) lens_of_[id] = lens;
    for (const auto& [id, known] : known_) {
      if (known.lens && !known.HasLearned()) num_pairs_[lens_of_[id]] = known.lens->num_pairs;
      const bool has_open_focal = !known.camera.IsPlanar() && !known.camera.FocalIndices().empty();
      if (has_open_focal && !IsKnown(id)) open[lens_of_[id]].push_back(id);
    }
    if (open.empty()) return {};
    const std::map<camera_t, std::vector<image_pair_t>> pairs_of = FindPairs();
    std::vector<std::string> texts;
    for (const auto& [lens, cameras] : open) {
      if (run_.monitor.StopRequested()) break;
      const auto of_lens = pairs_of.find(lens);
      const std::vector<image_pair_t> usable =
          of_lens == pairs_of.end() ? std::vector<image_pair_t>() : of_lens->second;
      // (More pairs may determine what fewer could not.)
      const auto before = num_pairs_.find(lens);
      if (before != num_pairs_.end() && before->second == std::ssize(usable)) continue;
      texts.push_back(Find(lens, cameras, usable));
    }
    return texts;
  }

  bool HasMoreSupport(const std::map<camera_t, Camera>& others) {
    const camera_t lens = others.begin()->first;
    for (const auto& [id, other] : others) lens_of_[id] = lens;
    const std::vector<WidePair> pairs = ReadPairs(FindPairs()[lens]);
    const double before = Supports(lens, pairs, {kAsItIs}).front();
    for (const auto& [id, other] : others) cameras_.at(id) = other;
    return FindBest(lens, pairs, others.at(lens).MeanFocal()).support > before;
  }

 private:
  static constexpr double kAsItIs = 0;  // in place of a focal length
  struct Found {
    double focal_px = 0;
    double support = 0;
  };

  // Is the focal length more than a guess?
  bool IsKnown(camera_t id) const {
    const KnownIntrinsics& known = known_.at(id);
    return known.HasPriorFocal() || known.HasLearned() || known.IsConstant();
  }

  // The focal length of the lens near the guess by which the pairs have the most support.
  Found FindBest(camera_t lens, const std::vector<WidePair>& pairs, double guess) const {
    Found best{guess, 0};
    const auto try_around = [&](double center, double reach, double step) {
      std::vector<double> focals;
      for (double power = -reach; power <= reach + 1e-9; power += step) {
        focals.push_back(center * std::exp2(power));
      }
      const std::vector<double> supports = Supports(lens, pairs, focals);
      for (size_t k = 0; k < focals.size(); ++k) {
        if (supports[k] > best.support) best = {focals[k], supports[k]};
      }
    };
    try_around(guess, kReach, kCoarseStep);
    if (best.support > 0) try_around(best.focal_px, kCoarseStep - kFineStep, kFineStep);
    return best;
  }

  // Of the cameras of one lens, by these pairs, those with the most matches first.
  std::string Find(camera_t lens, const std::vector<camera_t>& cameras,
                   const std::vector<image_pair_t>& usable) {
    const double guess = cameras_.at(cameras.front()).MeanFocal();
    const std::vector<WidePair> pairs = ReadPairs(usable);
    const Found best = FindBest(lens, pairs, guess);
    CameraLens found{.num_pairs = static_cast<int>(usable.size())};
    if (best.support > 0) found.focal_px = best.focal_px;
    Store(cameras, found);
    std::string text = "camera " + std::to_string(cameras.front());
    if (cameras.size() > 1) text += Formatted(" and %zu of its kind", cameras.size() - 1);
    return best.support > 0
               ? text + Formatted(": focal length %.1f px by %zu pairs (guessed %.1f)",
                                  found.focal_px, pairs.size(), guess)
               : text + Formatted(
                            ": no pair determines the focal length; the guess of %.1f px is "
                            "kept",
                            guess);
  }

  // Pairs that were verified with the guess are to be verified again.
  void Store(const std::vector<camera_t>& cameras, const CameraLens& lens) {
    Database::Transaction transaction(database_);
    for (const camera_t id : cameras) {
      database_.WriteCameraLens(id, lens);
      ApplyLens(lens, cameras_.at(id));
    }
    if (!lens.IsEmpty()) {
      UndoVerification(database_, camera_of_, {cameras.begin(), cameras.end()});
    }
    transaction.Commit();
  }

  // Of each lens, the pairs of images that both have it, or one of them and the other a camera that
  // is known; those with the most matches first.
  std::map<camera_t, std::vector<image_pair_t>> FindPairs() const {
    std::vector<std::pair<int, image_pair_t>> ranked;
    for (const auto& [pair_id, count] : database_.ReadNumMatches()) {
      if (count >= options_.min_num_matches) ranked.emplace_back(-count, pair_id);
    }
    std::sort(ranked.begin(), ranked.end());
    std::map<camera_t, std::vector<image_pair_t>> pairs;
    for (const auto& [count, pair_id] : ranked) {
      const auto [image1, image2] = PairIdToImagePair(pair_id);
      const auto camera1 = camera_of_.find(image1), camera2 = camera_of_.find(image2);
      if (camera1 == camera_of_.end() || camera2 == camera_of_.end()) continue;
      const auto lens1 = lens_of_.find(camera1->second), lens2 = lens_of_.find(camera2->second);
      if (lens1 == lens_of_.end() || lens2 == lens_of_.end()) continue;  // of unknown models
      const bool is_one = lens1->second == lens2->second;
      if (is_one || IsKnown(camera2->second)) pairs[lens1->second].push_back(pair_id);
      if (!is_one && IsKnown(camera1->second)) pairs[lens2->second].push_back(pair_id);
    }
    return pairs;
  }

  std::vector<WidePair> ReadPairs(std::vector<image_pair_t> ranked) const {
    ranked.resize(std::min<size_t>(ranked.size(), kMaxWidePairs * kSpread));
    const size_t step = (ranked.size() + kMaxWidePairs - 1) / kMaxWidePairs;
    const MatchOrigins origins(database_);
    std::vector<WidePair> pairs;
    for (size_t i = 0; i < ranked.size() && pairs.size() < kMaxWidePairs; i += step) {
      WidePair pair;
      pair.pair_id = ranked[i];
      const auto [image1, image2] = PairIdToImagePair(pair.pair_id);
      pair.camera1 = &cameras_.at(camera_of_.at(image1));
      pair.camera2 = &cameras_.at(camera_of_.at(image2));
      pair.are_best_first = origins.AreOurs(pair.pair_id);
      try {
        pair.keypoints1 = database_.ReadKeypoints(image1).value_or(std::vector<Keypoint>());
        pair.keypoints2 = database_.ReadKeypoints(image2).value_or(std::vector<Keypoint>());
        pair.matches = database_.ReadMatches(pair.pair_id).value_or(FeatureMatches());
      } catch (const IoError&) {  // The verification of the pair reports it.
        continue;
      }
      std::erase_if(pair.matches, [&pair](const FeatureMatch& match) {
        return match.point1 >= pair.keypoints1.size() || match.point2 >= pair.keypoints2.size();
      });
      pairs.push_back(std::move(pair));
    }
    return pairs;
  }

  // The support of all pairs at each focal length of the lens.
  std::vector<double> Supports(camera_t lens, const std::vector<WidePair>& pairs,
                               const std::vector<double>& focals) const {
    std::vector<double> of_task(pairs.size() * focals.size());
    ParallelFor(run_.num_threads, std::ssize(of_task), [&](int64_t task) {
      const WidePair& pair = pairs[task % pairs.size()];
      const double focal = focals[task / pairs.size()];
      Camera camera1 = *pair.camera1, camera2 = *pair.camera2;
      for (Camera* camera : {&camera1, &camera2}) {
        const bool is_of_lens = lens_of_.at(camera->camera_id) == lens;
        if (is_of_lens && focal != kAsItIs) camera->SetMeanFocal(focal);
      }
      PairInput input;
      input.pair_id = pair.pair_id;
      input.seed = run_.seed;
      input.camera1 = &camera1;
      input.camera2 = &camera2;
      input.keypoints1 = pair.keypoints1;
      input.keypoints2 = pair.keypoints2;
      input.matches = pair.matches;
      input.are_best_first = pair.are_best_first;
      const PairReport report = MakePairVerifier(VerifierKind::kCascade, options_)->Verify(input);
      if (report.status == PairStatus::kVerified) of_task[task] = report.score;
    });
    std::vector<double> supports;
    for (size_t k = 0; k < focals.size(); ++k) {
      double sum = 0.0;
      for (size_t i = 0; i < pairs.size(); ++i) sum += of_task[k * pairs.size() + i];
      supports.push_back(sum);
    }
    return supports;
  }

  Database& database_;
  const TwoViewOptions& options_;
  const RunContext& run_;
  const std::map<camera_t, KnownIntrinsics> known_;
  const std::map<image_t, camera_t> camera_of_;
  std::map<camera_t, Camera> cameras_;    // as they are, or are tried
  std::map<camera_t, camera_t> lens_of_;  // the camera that stands for it
  std::map<camera_t, int> num_pairs_;     // of a lens, when it was looked at
};

}  // namespace

std::vector<std::string> LearnWideFocals(Database& database, const TwoViewOptions& options,
                                         const RunContext& run) {
  return WideFocalFinder(database, options, run).Run();
}

bool HasMoreSupport(Database& database, const std::map<camera_t, Camera>& others,
                    const TwoViewOptions& options, const RunContext& run) {
  return WideFocalFinder(database, options, run).HasMoreSupport(others);
}

}  // namespace cairn
