// Cameras around a thing that looks alike from several sides: most pairs agree on one side.
#include <algorithm>
#include <numbers>
#include <numeric>

#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "mapper/stages.h"
#include "support/test.h"

namespace cairn {
namespace {

constexpr int kNumImages = 36;
constexpr int kPeriod = 12;  // the thing looks alike from every 12th image
constexpr int kReach = 2;    // neighbors see the same
constexpr int kNumPoints = 100;

Eigen::Quaterniond CameraAt(int steps) {
  return ExpSO3({0, 2 * std::numbers::pi * steps / kNumImages, 0});
}

// The steps from -period / 2 to period / 2 that lead as far around.
int Wrapped(int steps, int period) {
  return ((steps + period / 2) % period + period) % period - period / 2;
}

// What neighbors share covers their pictures. Other pairs, if they match, share the thing in the
// middle alone, with twice as many inliers.
struct ThingOfThreeSides {
  explicit ThingOfThreeSides(bool others_match) {
    scene.cameras[1] = Camera::FromFocal(1, CameraModel::kPinhole, 800, 640, 480);
    Rng rng(1);
    for (image_t id = 1; id <= kNumImages; ++id) {
      graph.image_ids.push_back(id);
      scene.images[id] = {id, std::to_string(id) + ".jpg", 1};
      for (int k = 0; k < 3 * kNumPoints; ++k) {
        const double reach = k < kNumPoints ? 1.0 : 0.2;
        scene.pixels[id].push_back({320 + 320 * reach * rng.Uniform(-1, 1),  //
                                    240 + 240 * reach * rng.Uniform(-1, 1)});
      }
      for (image_t other = 1; other < id; ++other) AddPair(other, id, others_match);
    }
  }

  void AddPair(image_t id1, image_t id2, bool others_match) {
    const int steps = static_cast<int>(id2) - static_cast<int>(id1);
    const bool are_neighbors = std::abs(Wrapped(steps, kNumImages)) <= kReach;
    const int seen = Wrapped(steps, are_neighbors ? kNumImages : kPeriod);
    if (std::abs(seen) > kReach || !(are_neighbors || others_match)) return;
    FeatureMatches& matches = scene.matches[ImagePairToPairId(id1, id2)];
    const point2D_t begin = are_neighbors ? 0 : kNumPoints;
    const point2D_t end = are_neighbors ? kNumPoints : 3 * kNumPoints;
    for (point2D_t k = begin; k < end; ++k) matches.push_back({k, k});
    ViewEdge edge;
    edge.image_id1 = id1;
    edge.image_id2 = id2;
    edge.cam2_from_cam1.rotation = CameraAt(seen);
    edge.num_inliers = static_cast<int>(matches.size());
    graph.edges.push_back(edge);
  }

  std::vector<RotationHypothesis> Hypotheses() {
    ReconstructSettings settings;
    RunReport report;
    StageContext context{scene, settings, {.num_threads = 1}, report};
    std::vector<image_t> images(kNumImages);
    std::iota(images.begin(), images.end(), 1);
    return HypothesizeRotations(context, images, graph);
  }

  SceneData scene;
  ViewGraph graph;
};

bool IsTruth(const RotationHypothesis& hypothesis) {
  const Eigen::Quaterniond& first = hypothesis.cam_from_world.at(1);
  const auto is_right = [&](const auto& entry) {
    const auto& [id, rotation] = entry;
    const Eigen::Quaterniond truth = CameraAt(static_cast<int>(id) - 1) * first;
    return RadToDeg(AngleBetween(rotation, truth)) < 1;
  };
  return std::all_of(hypothesis.cam_from_world.begin(), hypothesis.cam_from_world.end(), is_right);
}

TEST(HypothesizeRotations, TriesWhatPairsOfWholePicturesSayAgainstTheVotesOfMany) {
  const std::vector<RotationHypothesis> found = ThingOfThreeSides(true).Hypotheses();
  ASSERT_GT(found.size(), 1u);
  EXPECT_FALSE(IsTruth(found.front()));
  EXPECT_TRUE(std::any_of(found.begin(), found.end(), IsTruth));
}

TEST(HypothesizeRotations, HasOneWhereAllAgree) {
  const std::vector<RotationHypothesis> found = ThingOfThreeSides(false).Hypotheses();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(IsTruth(found[0]));
}

}  // namespace
}  // namespace cairn
