#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <set>
#include <utility>

#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/database/database.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/io/colmap_model.h"
#include "cairn/synthetic/poses.h"
#include "cairn/synthetic/scene.h"
#include "synthetic/city.h"
#include "synthetic/edge_errors.h"
#include "synthetic/pair_choice.h"
#include "synthetic/visible_points.h"

namespace cairn {
namespace {

constexpr size_t kPairsPerTransaction = 1000;

// One pair's rows, made in parallel, written in order.
struct PairRows {
  FeatureMatches matches;
  TwoViewGeometry geometry;
  PairMetrics metrics;
};

// The pairs of images, and what is wrong with some of them.
struct PairPlan {
  std::vector<std::pair<int64_t, int64_t>> pairs;  // indices of images
  std::vector<char> is_outlier;
};

std::vector<VisiblePoints> FindAllVisiblePoints(const SyntheticScene& scene) {
  std::vector<VisiblePoints> visible(scene.images.size());
  ParallelFor(scene.num_threads, std::ssize(visible),
              [&](int64_t i) { visible[i] = FindVisiblePoints(scene, scene.images[i].image_id); });
  return visible;
}

// Points that image 1 shows of its place and image 2 of the twin place, as if they were the same.
FeatureMatches FindTwinMatches(const SyntheticScene& scene, const City& city, int64_t i, int64_t j,
                               const std::vector<VisiblePoints>& visible) {
  const auto size = static_cast<point3D_t>(scene.options.num_points / city.NumPlaces());
  // By their numbers within the place.
  const auto alike = [&](int64_t image) {
    const point3D_t first = 1 + city.PlaceOf(image) * size;
    VisiblePoints points;
    for (const auto& [id, keypoint] : visible[image]) {
      const bool is_of_place = id >= first && id < first + size;
      if (is_of_place && (id - first) % City::kAlikeEvery == 0) {
        points.emplace_back(id - first, keypoint);
      }
    }
    return points;
  };
  return CommonPoints(alike(i), alike(j));
}

// True pairs of neighboring places, and wrong ones of twins.
PairPlan PlanCityPairs(const SyntheticScene& scene, const std::vector<VisiblePoints>& visible) {
  constexpr size_t kMinCommon = 15;
  const auto n = static_cast<int64_t>(scene.images.size());
  const City city(scene.options.num_images);
  std::vector<std::vector<CandidatePair>> of_image[2];  // true and wrong ones
  for (auto& candidates : of_image) candidates.resize(n);
  ParallelFor(scene.num_threads, n, [&](int64_t i) {
    const int place = city.PlaceOf(i);
    for (int64_t j = i + 1; j < n; ++j) {
      const bool is_wrong = !city.AreNeighbors(place, city.PlaceOf(j));
      if (is_wrong && city.PlaceOf(j) != city.TwinOf(place)) continue;
      const size_t num_common = is_wrong ? FindTwinMatches(scene, city, i, j, visible).size()
                                         : CommonPoints(visible[i], visible[j]).size();
      if (num_common < kMinCommon) continue;
      of_image[is_wrong][i].push_back(
          {static_cast<int>(i), static_cast<int>(j), -static_cast<float>(num_common)});
    }
  });
  const auto num_pairs = static_cast<size_t>(scene.options.num_pairs);
  const auto num_wrong = static_cast<size_t>(
      std::lround(scene.options.pair_outlier_ratio * static_cast<double>(num_pairs)));
  PairPlan plan;
  for (const bool is_wrong : {false, true}) {
    std::vector<CandidatePair> candidates;
    for (const auto& some : of_image[is_wrong]) {
      candidates.insert(candidates.end(), some.begin(), some.end());
    }
    for (const size_t k :
         ChoosePairs(n, candidates, is_wrong ? num_wrong : num_pairs - num_wrong)) {
      plan.pairs.emplace_back(candidates[k].item1, candidates[k].item2);
      plan.is_outlier.push_back(is_wrong);
    }
  }
  return plan;
}

PairPlan PlanPairs(const SyntheticScene& scene, const std::vector<VisiblePoints>& visible) {
  const auto wanted = static_cast<size_t>(scene.options.num_pairs);
  if (scene.options.layout == CameraLayout::kCity && wanted > 0) {
    return PlanCityPairs(scene, visible);
  }
  const size_t n = scene.images.size();
  std::vector<CandidatePair> candidates;
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = i + 1; j < n; ++j) {
      candidates.push_back({static_cast<int>(i), static_cast<int>(j), 0});
    }
  }
  PairPlan plan;
  if (wanted > 0 && wanted < candidates.size()) {
    ParallelFor(scene.num_threads, std::ssize(candidates), [&](int64_t k) {
      CandidatePair& pair = candidates[k];
      pair.cost =
          -static_cast<float>(CommonPoints(visible[pair.item1], visible[pair.item2]).size());
    });
    for (const size_t k : ChoosePairs(n, candidates, std::max(wanted, n - 1))) {
      plan.pairs.emplace_back(candidates[k].item1, candidates[k].item2);
    }
  } else {
    for (const CandidatePair& pair : candidates) plan.pairs.emplace_back(pair.item1, pair.item2);
  }
  plan.is_outlier.assign(plan.pairs.size(), 0);
  const double ratio = scene.options.pair_outlier_ratio;
  std::fill_n(plan.is_outlier.begin(), std::lround(ratio * static_cast<double>(plan.pairs.size())),
              1);
  Rng(scene.seed, "scene_pair_outliers").Shuffle(plan.is_outlier);
  return plan;
}

// A pair that was verified by mistake, with this pose.
PairRows WrongPair(FeatureMatches matches, const Rigid3d& cam2_from_cam1) {
  PairRows rows;
  rows.geometry.config = TwoViewConfig::kCalibrated;
  rows.geometry.cam2_from_cam1 = cam2_from_cam1;
  rows.geometry.inlier_matches = matches;
  rows.matches = std::move(matches);
  return rows;
}

PairRows MakeOutlierPair(const SyntheticScene& scene, image_t id1, image_t id2) {
  Rng rng(scene.seed, "scene_outlier_pair", ImagePairToPairId(id1, id2));
  FeatureMatches matches;
  const size_t n1 = scene.keypoints.at(id1).size();
  const size_t n2 = scene.keypoints.at(id2).size();
  std::set<point2D_t> used1, used2;
  for (int k = NumChanceInliers(rng); k > 0 && n1 > 0 && n2 > 0; --k) {
    const FeatureMatch match{rng.UniformInt(static_cast<uint32_t>(n1)),
                             rng.UniformInt(static_cast<uint32_t>(n2))};
    if (used1.insert(match.point1).second && used2.insert(match.point2).second) {
      matches.push_back(match);
    }
  }
  const Eigen::Quaterniond rotation = RandomRotation(rng);
  return WrongPair(std::move(matches), Rigid3d(rotation, RandomDirection(rng)));
}

class PairMaker {
 public:
  explicit PairMaker(const SyntheticScene& scene)
      : scene_(scene), visible_(FindAllVisiblePoints(scene)), plan_(PlanPairs(scene, visible_)) {
    Rng rng(scene.seed, "scene_edge_errors");
    errors_ =
        std::make_unique<EdgeErrors>(scene.options, static_cast<int>(scene.images.size()), rng);
  }

  size_t NumPairs() const { return plan_.pairs.size(); }
  image_pair_t PairId(size_t pair) const {
    const auto [i, j] = plan_.pairs[pair];
    return ImagePairToPairId(scene_.images[i].image_id, scene_.images[j].image_id);
  }

  PairRows Make(size_t pair, bool with_geometry) const {
    const auto [i, j] = plan_.pairs[pair];
    const auto [id1, id2] = PairIdToImagePair(PairId(pair));
    PairRows rows;
    if (plan_.is_outlier[pair]) {
      const bool is_city = scene_.options.layout == CameraLayout::kCity;
      rows = is_city ? MakeTwinPair(i, j) : MakeOutlierPair(scene_, id1, id2);
    } else {
      const SyntheticMatches matches = MakeMatches(scene_, id1, id2, visible_[i], visible_[j]);
      rows.matches = matches.matches;
      if (with_geometry && std::count(matches.is_inlier.begin(), matches.is_inlier.end(), true)) {
        rows.geometry = TrueTwoViewGeometry(scene_, id1, id2, matches);
        Disturb(i, j, &rows.geometry);
      }
    }
    FillMetrics(PairId(pair), &rows);
    return rows;
  }

 private:
  // The second image as if it were of the place that looks the same.
  PairRows MakeTwinPair(int64_t i, int64_t j) const {
    const City city(scene_.options.num_images);
    const auto pose = [&](int64_t image) {
      return scene_.truth.images.at(scene_.images[image].image_id).cam_from_world;
    };
    Rigid3d cam2_from_cam1 =
        pose(j) * city.Motion(city.PlaceOf(i), city.PlaceOf(j)) * Inverse(pose(i));
    cam2_from_cam1.translation.normalize();
    PairRows rows = WrongPair(FindTwinMatches(scene_, city, i, j, visible_), cam2_from_cam1);
    Disturb(i, j, &rows.geometry);
    return rows;
  }

  void Disturb(size_t i, size_t j, TwoViewGeometry* geometry) const {
    const SceneOptions& options = scene_.options;
    if (options.rotation_noise_deg == 0 && options.direction_noise_deg == 0) return;
    Rng rng(scene_.seed, "scene_pair_errors", ImagePairToPairId(i + 1, j + 1));
    errors_->Perturb(i, j, rng, &*geometry->cam2_from_cam1);
    geometry->E.reset();
    geometry->F.reset();
  }

  static void FillMetrics(image_pair_t pair_id, PairRows* rows) {
    PairMetrics& metrics = rows->metrics;
    metrics.pair_id = pair_id;
    metrics.verifier = metrics.step = "synthetic";
    metrics.num_matches = static_cast<int>(rows->matches.size());
    metrics.num_inliers = static_cast<int>(rows->geometry.inlier_matches.size());
    metrics.is_winner = rows->geometry.cam2_from_cam1.has_value();
    metrics.status = metrics.is_winner ? "verified" : "no_model";
    metrics.cam2_from_cam1 = rows->geometry.cam2_from_cam1;
  }

  const SyntheticScene& scene_;
  std::vector<VisiblePoints> visible_;
  PairPlan plan_;
  std::unique_ptr<EdgeErrors> errors_;
};

void WritePairs(const SyntheticScene& scene, bool with_geometries, Database& database) {
  const PairMaker maker(scene);
  for (size_t begin = 0; begin < maker.NumPairs(); begin += kPairsPerTransaction) {
    std::vector<PairRows> rows(std::min(kPairsPerTransaction, maker.NumPairs() - begin));
    ParallelFor(scene.num_threads, std::ssize(rows),
                [&](int64_t k) { rows[k] = maker.Make(begin + k, with_geometries); });
    Database::Transaction transaction(database);
    for (size_t k = 0; k < rows.size(); ++k) {
      if (rows[k].matches.empty()) continue;
      database.WriteMatches(maker.PairId(begin + k), rows[k].matches);
      if (!with_geometries) continue;
      database.WriteTwoViewGeometry(maker.PairId(begin + k), rows[k].geometry);
      if (scene.options.pair_metrics) database.WritePairMetrics(rows[k].metrics);
    }
    transaction.Commit();
  }
}

}  // namespace

void WriteScene(const SyntheticScene& scene, SceneContent content, Database& database) {
  Database::Transaction transaction(database);
  for (const auto& [id, camera] : scene.cameras) database.WriteCamera(camera);
  for (const Image& image : scene.images) {
    database.WriteImage(image);
    database.WriteKeypoints(image.image_id, scene.keypoints.at(image.image_id));
    if (scene.options.descriptors) {
      database.WriteDescriptors(image.image_id, MakeDescriptors(scene, image.image_id));
    }
    if (content >= SceneContent::kDepth) {
      database.WriteDepthSamples(image.image_id, scene.depth_samples.at(image.image_id));
    }
  }
  transaction.Commit();
  if (content >= SceneContent::kMatches) {
    WritePairs(scene, content >= SceneContent::kTwoViewGeometries, database);
  }
}

void WriteSceneFolder(const SyntheticScene& scene, SceneContent content,
                      const std::string& folder) {
  CreateFolders(folder);
  const std::string path = folder + "/scene.db";
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path + suffix);
  Database database(path);
  WriteScene(scene, content, database);
  WriteColmapModel(scene.truth, folder + "/truth");
}

}  // namespace cairn
