#include "cairn/evaluation/model_evidence.h"

#include <gtest/gtest.h>

#include <numbers>

#include "cairn/geometry/rigid3d.h"
#include "support/synthetic_reconstruction.h"

namespace cairn {
namespace {

using testing_support::MadeReconstruction;
using testing_support::MakeSyntheticScene;

// All pairs of images, with the matches that their common points give.
struct Pairs {
  explicit Pairs(const Reconstruction& truth) {
    for (const auto& [id, point] : truth.points3D) {
      for (size_t a = 0; a < point.track.size(); ++a) {
        for (size_t b = a + 1; b < point.track.size(); ++b) {
          const TrackElement &first = point.track[a], &second = point.track[b];
          matches[{first.image_id, second.image_id}].push_back({first.point2D, second.point2D});
        }
      }
    }
    for (const auto& [ids, found] : matches) views.push_back({ids.first, ids.second, &found});
  }
  std::map<std::pair<image_t, image_t>, FeatureMatches> matches;
  std::vector<VerifiedPair> views;
};

Reconstruction Turned(Reconstruction model, image_t id, double angle) {
  Rigid3d& pose = model.images.at(id).cam_from_world;
  const Eigen::Vector3d center = pose.Center();
  pose.rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()) * pose.rotation;
  pose.translation = pose.rotation * -center;
  return model;
}

TEST(ModelEvidence, TheTruthExplainsAllMatches) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.3});
  const Pairs pairs(scene.truth);
  const ModelEvidence evidence = EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 1});
  EXPECT_EQ(evidence.all.num_explained, evidence.all.num_matches);
  EXPECT_EQ(evidence.inside.num_matches, evidence.all.num_matches);
  EXPECT_EQ(evidence.num_pairs, 15);
  EXPECT_EQ(evidence.num_contradicted, 0);
  EXPECT_EQ(evidence.pairs.size(), pairs.views.size());
  // Some six nats a match: the logarithm of the image's width over the noise.
  EXPECT_GT(evidence.nats, 4.5 * static_cast<double>(evidence.all.num_matches));
  EXPECT_LT(evidence.nats, 7.0 * static_cast<double>(evidence.all.num_matches));
}

TEST(ModelEvidence, DoesNotDependOnTheWorldFrameOrOnThreads) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.5});
  const Pairs pairs(scene.truth);
  const double nats = EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 1}).nats;
  EXPECT_EQ(EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 8}).nats, nats);
  Reconstruction moved = scene.truth;
  Sim3d change;
  change.scale = 7;
  change.rotation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized();
  change.translation = Eigen::Vector3d(3, -2, 5);
  moved.Transform(change);
  EXPECT_NEAR(EvaluateEvidence(moved, pairs.views, {.num_threads = 1}).nats, nats, 1e-6 * nats);
}

TEST(ModelEvidence, AWrongPoseIsContradictedByItsOwnPairs) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.3});
  const Pairs pairs(scene.truth);
  const ModelEvidence truth = EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 1});
  const ModelEvidence wrong =
      EvaluateEvidence(Turned(scene.truth, 3, 0.1), pairs.views, {.num_threads = 1});
  EXPECT_LT(wrong.nats, truth.nats);
  // (A pair may have its epipole where the turn moves points along the lines.)
  EXPECT_GE(wrong.num_contradicted, 4);
  EXPECT_TRUE(wrong.images.at(3).IsContradicted());
  EXPECT_FALSE(wrong.images.at(1).IsContradicted());
  // A focal length that is off, too, though by less.
  Reconstruction other = scene.truth;
  for (auto& [id, camera] : other.cameras) camera.SetMeanFocal(1.2 * camera.MeanFocal());
  EXPECT_LT(EvaluateEvidence(other, pairs.views, {.num_threads = 1}).nats, truth.nats);
}

TEST(ModelEvidence, PointsBehindACameraAreNotExplained) {
  const MadeReconstruction scene = MakeSyntheticScene({});
  const Pairs pairs(scene.truth);
  // The world seen from the other side: every epipolar line stays, every point lies behind.
  Reconstruction mirrored = scene.truth;
  for (auto& [id, image] : mirrored.images) image.cam_from_world.translation *= -1;
  const ModelEvidence evidence = EvaluateEvidence(mirrored, pairs.views, {.num_threads = 1});
  EXPECT_LT(evidence.all.Share(), 0.05);
}

// A camera that is turned by half a turn about the baseline sees the same epipolar lines, and every
// point lies behind one of the two (the twisted pair; Hartley and Zisserman, 9.6.2).
TEST(ModelEvidence, PointsBehindOneOfTwoCamerasAreNotExplained) {
  const MadeReconstruction scene = MakeSyntheticScene({});
  const Pairs pairs(scene.truth);
  const VerifiedPair& pair = pairs.views.front();
  for (const image_t id : {pair.image_id1, pair.image_id2}) {
    Reconstruction twisted = scene.truth;
    const Eigen::Vector3d baseline = (twisted.images.at(pair.image_id2).cam_from_world.Center() -
                                      twisted.images.at(pair.image_id1).cam_from_world.Center())
                                         .normalized();
    Rigid3d& pose = twisted.images.at(id).cam_from_world;
    const Eigen::Vector3d center = pose.Center();
    pose.rotation = pose.rotation * Eigen::AngleAxisd(std::numbers::pi, baseline);
    pose.translation = pose.rotation * -center;
    const ModelEvidence evidence = EvaluateEvidence(twisted, {&pair, 1}, {.num_threads = 1});
    EXPECT_LT(evidence.all.Share(), 0.05) << id;
  }
}

TEST(ModelEvidence, AnImageThatIsMissingCostsItsMatches) {
  const MadeReconstruction scene = MakeSyntheticScene({.noise_px = 0.3});
  const Pairs pairs(scene.truth);
  Reconstruction smaller = scene.truth;
  for (size_t k = 0; k < smaller.images.at(2).point3D_ids.size(); ++k) {
    const point3D_t id = smaller.images.at(2).point3D_ids[k];
    if (id != kInvalidPoint3DId) smaller.RemoveObservation(id, {2, static_cast<point2D_t>(k)});
  }
  smaller.images.erase(2);
  const ModelEvidence all = EvaluateEvidence(scene.truth, pairs.views, {.num_threads = 1});
  const ModelEvidence less = EvaluateEvidence(smaller, pairs.views, {.num_threads = 1});
  EXPECT_LT(less.nats, all.nats);
  EXPECT_EQ(less.all.num_matches, all.all.num_matches);
  EXPECT_LT(less.inside.num_matches, all.inside.num_matches);
  EXPECT_EQ(less.num_pairs, 10);
  EXPECT_EQ(less.num_contradicted, 0);
}

}  // namespace
}  // namespace cairn
