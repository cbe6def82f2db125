#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <utility>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/database/report_bad_rows.h"
#include "cairn/mapper/view_edges.h"
#include "intrinsics/known_intrinsics.h"
#include "mapper/stages.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

// Of a frame, px: more than any image has.
constexpr double kLongestAxis = 1e6;

// The smaller singular value of the frame.
float ShorterAxis(const Keypoint& k) {
  const double squares = k.a11 * k.a11 + k.a12 * k.a12 + k.a21 * k.a21 + k.a22 * k.a22;
  const double det = std::abs(k.a11 * k.a22 - k.a12 * k.a21);
  const double sum = std::sqrt(squares + 2 * det);  // of the singular values
  const double difference = std::sqrt(std::max(0.0, squares - 2 * det));
  const double axis = 0.5 * (sum - difference);  // no number where frames of strangers overflow
  return static_cast<float>(axis < kLongestAxis ? axis : kLongestAxis);
}

using IntrinsicsMap = std::map<camera_t, KnownIntrinsics>;

void ReadImagesAndKeypoints(const Database& database, const IntrinsicsMap& intrinsics,
                            SceneData& scene, Stage& stage,
                            std::map<image_t, std::vector<point2D_t>>& first_keypoint) {
  for (const auto& [id, known] : intrinsics) {
    Camera& camera = scene.cameras[id] = known.camera;
    if (known.IsRejected()) camera.has_prior_focal_length = false;
  }
  std::map<camera_t, int64_t> unknown_models;
  for (const UnknownCamera& camera : database.ReadUnknownCameras()) {
    unknown_models[camera.camera_id] = camera.model_id;
  }
  for (const Image& image : database.ReadImages()) {
    scene.images[image.image_id] = image;
    const auto skip = [&](const std::string& reason) {
      stage.Warn(image.name + ": left out: " + reason);
    };
    const auto unknown = unknown_models.find(image.camera_id);
    if (unknown != unknown_models.end()) {
      skip("camera " + std::to_string(image.camera_id) + " is of the unknown model " +
           std::to_string(unknown->second));
      continue;
    }
    const auto camera = scene.cameras.find(image.camera_id);
    if (camera == scene.cameras.end()) {
      skip("the database has no camera " + std::to_string(image.camera_id));
      continue;
    }
    if (const std::string reason = camera->second.Validate(); !reason.empty()) {
      skip("camera " + std::to_string(image.camera_id) + ": " + reason);
      continue;
    }
    std::vector<Keypoint> keypoints;
    try {
      keypoints = database.ReadKeypoints(image.image_id).value_or(std::vector<Keypoint>());
    } catch (const IoError& error) {
      skip(error.reason());
      continue;
    }
    std::vector<Eigen::Vector2d>& pixels = scene.pixels[image.image_id];
    pixels.reserve(keypoints.size());
    std::vector<float>& scales = scene.scales[image.image_id];
    scales.reserve(keypoints.size());
    for (const Keypoint& keypoint : keypoints) {
      pixels.push_back(keypoint.Position());
      scales.push_back(ShorterAxis(keypoint));
    }
    first_keypoint[image.image_id] = FirstKeypointsAtPosition(keypoints);
  }
}

// Inlier matches with every keypoint replaced by the first one at its position.
FeatureMatches MergeMatches(FeatureMatches matches, const std::vector<point2D_t>& first1,
                            const std::vector<point2D_t>& first2) {
  std::erase_if(matches, [&](const FeatureMatch& match) {
    return match.point1 >= first1.size() || match.point2 >= first2.size();
  });
  for (FeatureMatch& match : matches) {
    match = {first1[match.point1], first2[match.point2]};
  }
  matches = Unique(std::move(matches));
  return matches;
}

// Edges with their merged inlier matches; geometries of those that another program verified.
void ReadEdges(const Database& database,
               const std::map<image_t, std::vector<point2D_t>>& first_keypoint, int num_threads,
               Stage& stage, SceneData& scene) {
  std::vector<std::string> bad;
  const auto warn = [&](const std::string& message) { bad.push_back(message); };
  const auto is_used = [&](const ViewEdge& edge) {
    return scene.pixels.contains(edge.image_id1) && scene.pixels.contains(edge.image_id2);
  };
  const auto keep = [&](const ViewEdge& edge, TwoViewGeometry&& geometry) {
    if (!is_used(edge)) return;
    // What lies over the photographs, or does not move with the scene, is no evidence of it.
    const bool is_still = geometry.config == TwoViewConfig::kPanoramic && geometry.cam2_from_cam1 &&
                          !HasTurned(geometry.cam2_from_cam1->rotation);
    if (is_still || geometry.config == TwoViewConfig::kWatermark) geometry.inlier_matches.clear();
    scene.matches[edge.PairId()] = std::move(geometry.inlier_matches);
    if (edge.source == EdgeSource::kOtherProgram) {
      scene.foreign[edge.PairId()] = std::move(geometry);
    }
  };
  scene.edges = ReadViewEdges(database, warn, keep);
  std::vector<std::pair<const image_pair_t, FeatureMatches>*> pairs;
  for (auto& pair : scene.matches) pairs.push_back(&pair);
  ParallelFor(
      num_threads, std::ssize(pairs),
      [&](int64_t i) {
        auto& [pair_id, matches] = *pairs[i];
        const auto [id1, id2] = PairIdToImagePair(pair_id);
        matches = MergeMatches(std::move(matches), first_keypoint.at(id1), first_keypoint.at(id2));
      },
      /*grain=*/64);
  std::erase_if(scene.edges, [&](const ViewEdge& edge) { return !is_used(edge); });
  scene.poses_imported = std::ranges::any_of(
      scene.edges, [](const ViewEdge& edge) { return edge.source == EdgeSource::kDataset; });
  if (bad.empty()) return;
  stage.Add("bad_pairs", bad.size());
  stage.WarnEach(bad);
  stage.RecordWarning(
      ResultWarning{std::to_string(bad.size()) +
                        " pairs are left out, since their rows in the database cannot be "
                        "used: " +
                        bad.front(),
                    "was something written there after the pairs were verified?"});
}

SceneCounts CountScene(const Database& database) {
  SceneCounts counts;
  for (const auto& [id, num] : database.ReadNumKeypoints()) counts.num_keypoints += num;
  for (const auto& [id, num] : database.ReadNumInliers()) {
    ++counts.num_pairs;
    counts.num_matches += num;
  }
  return counts;
}

// All matches of a pair, none where there is no row; nullopt: the row cannot be read.
std::optional<FeatureMatches> ReadRawMatches(const Database& database, image_pair_t pair_id) {
  try {
    return database.ReadMatches(pair_id).value_or(FeatureMatches());
  } catch (const IoError&) {
    return std::nullopt;
  }
}

// What is read from the database later, on any thread.
void KeepReaders(const Database& database, std::map<image_t, std::vector<point2D_t>> first_keypoint,
                 SceneData& scene) {
  struct Reader {
    const Database& database;
    std::map<image_t, std::vector<point2D_t>> first_keypoint;
    std::mutex mutex = {};
  };
  // (Not by make_shared, which Clang 14 lacks for types without a constructor.)
  const std::shared_ptr<Reader> reader(new Reader{database, std::move(first_keypoint)});
  scene.raw_matches = [reader](const ViewEdge& edge) {
    const std::lock_guard<std::mutex> lock(reader->mutex);
    // (Verified matches can be read where all of them cannot.)
    return MergeMatches(ReadRawMatches(reader->database, edge.PairId()).value_or(FeatureMatches()),
                        reader->first_keypoint.at(edge.image_id1),
                        reader->first_keypoint.at(edge.image_id2));
  };
  scene.stored_geometry = [reader](image_pair_t pair_id) {
    const std::lock_guard<std::mutex> lock(reader->mutex);
    return reader->database.ReadTwoViewGeometry(pair_id).value();
  };
  scene.tried_pairs = [reader] {
    const std::lock_guard<std::mutex> lock(reader->mutex);
    std::vector<image_pair_t> pairs;
    for (const auto& [pair_id, num] : reader->database.ReadNumMatches()) pairs.push_back(pair_id);
    for (const auto& [pair_id, num] : reader->database.ReadNumInliers()) pairs.push_back(pair_id);
    return Unique(std::move(pairs));
  };
}

// Results of pairs that a run of build_view_graph left for the next one are missed. Those whose
// matches cannot be read, or are not of keypoints that can, are no work for it.
void WarnOfUnfinishedPairs(const Database& database, const SceneData& scene, Stage& stage) {
  const auto num_keypoints = [&](image_t id) {
    const auto pixels = scene.pixels.find(id);
    return pixels == scene.pixels.end() ? 0 : pixels->second.size();
  };
  const auto can_be_verified = [&](image_pair_t pair_id) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    const size_t num1 = num_keypoints(id1), num2 = num_keypoints(id2);
    if (num1 == 0 || num2 == 0) return false;
    const std::optional<FeatureMatches> matches = ReadRawMatches(database, pair_id);
    return matches && std::ranges::all_of(*matches, [&](const FeatureMatch& match) {
             return match.point1 < num1 && match.point2 < num2;
           });
  };
  const auto num_pairs = std::ranges::count_if(database.ReadPairsToVerify(), can_be_verified);
  stage.Add("pairs_to_verify", num_pairs);
  if (num_pairs == 0) return;
  const std::string pairs = num_pairs == 1 ? " pair of photos is" : " pairs of photos are";
  stage.RecordWarning(ResultWarning{std::to_string(num_pairs) + pairs + " not verified yet",
                                    "run build_view_graph to the end, then reconstruct"});
}

// By the user's option, or by what is known of each camera; warns where the two contradict.
void ChooseConstantCameras(const IntrinsicsMap& intrinsics,
                           const std::optional<bool>& refine_intrinsics, Stage& stage,
                           SceneData& scene) {
  int num_guessed = 0, num_contradicted = 0, num_unconfirmed = 0;
  std::string first, share;
  for (const auto& [id, known] : intrinsics) {
    if (refine_intrinsics ? *refine_intrinsics : !known.IsConstant()) continue;
    scene.constant_cameras.insert(id);
    num_guessed += !known.HasPriorFocal() && !known.IsConstant();
    num_unconfirmed += !refine_intrinsics && !known.is_given && !known.HasPriorFocal();
    if (!known.IsRejected() || num_contradicted++ > 0) continue;
    first = std::to_string(id);
    share = std::to_string(known.judgement->num_contradicting) + " of " +
            std::to_string(known.judgement->num_pairs);
  }
  if (num_contradicted > 0) {
    const std::string more =
        num_contradicted > 1 ? " (and of " + std::to_string(num_contradicted - 1) + " more)" : "";
    stage.Warn(ResultWarning{"the intrinsics of camera " + first + more + " are constant, but " +
                                 share + " pairs contradict its focal length",
                             "try --refine_intrinsics 1"});
  }
  if (num_unconfirmed > 0) {
    stage.Warn(ResultWarning{std::to_string(num_unconfirmed) +
                                 " cameras look measured (distortion, or a principal point off the "
                                 "center) and are constant, but the database calls their focal "
                                 "lengths guesses (prior_focal_length 0)",
                             "--refine_intrinsics 1 finds them from the photos"});
  }
  if (num_guessed == 0) return;
  stage.Warn(ResultWarning{"the focal lengths of " + std::to_string(num_guessed) +
                               " cameras are guesses, and constant: models are as wrong as they",
                           "leave out --refine_intrinsics 0, or give --camera_params"});
}

}  // namespace

SceneData ReadSceneData(const Database& database, const ReconstructSettings& settings,
                        const RunContext& run, RunReport& report) {
  SceneData scene;
  ReportBadRows(database, report, run.monitor);
  {
    RunStage stage(report, run.monitor, "read");
    if (!FitsToRead(CountScene(database), settings.reconstruct, stage)) return scene;
    std::map<image_t, std::vector<point2D_t>> first_keypoint;
    const IntrinsicsMap intrinsics = ReadKnownIntrinsics(database);
    ReadImagesAndKeypoints(database, intrinsics, scene, stage, first_keypoint);
    ReadEdges(database, first_keypoint, run.num_threads, stage, scene);
    KeepReaders(database, std::move(first_keypoint), scene);
    size_t num_matches = 0;
    for (const auto& [pair_id, matches] : scene.matches) num_matches += matches.size();
    scene.poses_alone = scene.poses_imported && num_matches == 0;
    ChooseConstantCameras(intrinsics, settings.refine_intrinsics, stage, scene);
    if (!scene.poses_imported) WarnOfUnfinishedPairs(database, scene, stage);
    scene.still_parts = FindStillParts(scene, run.num_threads);
    if (scene.still_parts) stage.RecordWarning(*scene.still_parts);
    stage.Add("cameras", scene.cameras.size());
    stage.Add("cameras_constant", scene.constant_cameras.size());
    stage.Add("images", scene.pixels.size());
    stage.Add("pairs", scene.edges.size());
    stage.Add("matches", num_matches);
    if (!scene.constant_cameras.empty()) {
      stage.Note("intrinsics of " + std::to_string(scene.constant_cameras.size()) + " of " +
                 std::to_string(scene.cameras.size()) +
                 " cameras are constant (--refine_intrinsics)");
    }
    const bool has_keypoints =
        std::ranges::any_of(scene.pixels, [](const auto& entry) { return !entry.second.empty(); });
    if (scene.pixels.empty() && !scene.images.empty()) {
      stage.Fail("the database has no image that can be used", "look at the warnings above");
    } else if (scene.pixels.empty() || (scene.edges.empty() && !has_keypoints)) {
      stage.Fail("the database has no image with keypoints",
                 "run build_view_graph with --image_path first");
    } else if (scene.edges.empty()) {
      stage.Fail("the database has " + std::to_string(scene.pixels.size()) +
                     " images and no verified pair",
                 "run build_view_graph up to verification, or try a larger --matching.max_ratio or "
                 "--features.max_num_features");
    }
    if (scene.poses_alone) {
      stage.Note(
          "the pairs have poses and no matches: only poses are averaged, there are no points");
    }
  }
  return scene;
}

}  // namespace cairn
