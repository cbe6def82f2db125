#include "cairn/evaluation/pose_evaluation.h"

#include <limits>
#include <nlohmann/json.hpp>

#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "support/test.h"

namespace cairn {
namespace {

Eigen::Vector3d RandomCenter(Rng& rng) { return {rng.Gaussian(), rng.Gaussian(), rng.Gaussian()}; }

PosedCameras RandomCameras(int n, Rng& rng) {
  PosedCameras cameras;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d translation = RandomCenter(rng);
    cameras["a/" + std::to_string(100 + i) + ".jpg"] = {
        Rigid3d(ExpSO3(RandomCenter(rng)), translation), 500.0 + i, 1000};
  }
  return cameras;
}

PosedCameras Transformed(const Sim3d& new_from_old, PosedCameras cameras) {
  for (auto& [name, camera] : cameras) {
    camera.cam_from_world = TransformCameraWorld(new_from_old, camera.cam_from_world);
  }
  return cameras;
}

TEST(PoseEvaluation, TheTruthInAnotherGaugeIsPerfect) {
  Rng rng(1);
  const PosedCameras reference = RandomCameras(9, rng);
  const PosedCameras estimate =
      Transformed({3, ExpSO3(RandomCenter(rng)), RandomCenter(rng)}, reference);
  const PoseEvaluation e = EvaluatePoses(estimate, reference);
  EXPECT_EQ(e.num_reference, 9);
  EXPECT_EQ(e.num_registered, 9);
  EXPECT_EQ(e.num_extra, 0);
  for (const double auc : e.auc) EXPECT_NEAR(auc, 1, 1e-12);
  EXPECT_LT(*e.relative_rotation_median_deg, 1e-12);
  EXPECT_LT(*e.relative_translation_median_deg, 1e-12);
  EXPECT_LT(e.center->mean, 1e-12);
  EXPECT_LT(e.orientation_deg->mean, 1e-9);
  EXPECT_EQ(e.focal_relative->mean, 0);
}

TEST(PoseEvaluation, KnownErrorsOfOneCamera) {
  Rng rng(2);
  const PosedCameras reference = RandomCameras(11, rng);
  PosedCameras estimate =
      Transformed({0.5, ExpSO3(RandomCenter(rng)), RandomCenter(rng)}, reference);
  PosedCamera& wrong = estimate["a/103.jpg"];
  // Turned by 2 degrees about its center, then moved by 0.3 of the reference's units.
  const Eigen::Vector3d center = wrong.cam_from_world.Center() + Eigen::Vector3d(0, 0.15, 0);
  wrong.cam_from_world.rotation =
      ExpSO3(DegToRad(2.0) * Eigen::Vector3d::UnitX()) * wrong.cam_from_world.rotation;
  wrong.cam_from_world.translation = wrong.cam_from_world.rotation * -center;
  wrong.focal_px *= 1.04;
  const PoseEvaluation e = EvaluatePoses(estimate, reference);
  EXPECT_NEAR(*e.images[3].orientation_deg, 2.0, 1e-6);
  EXPECT_NEAR(*e.images[3].center, 0.3, 1e-9);
  EXPECT_NEAR(*e.images[3].focal_relative, 0.04, 1e-12);
  EXPECT_NEAR(e.orientation_deg->mean, 2.0 / 11, 1e-6);
  EXPECT_LT(e.orientation_deg->median, 1e-6);
  EXPECT_NEAR(e.center->mean, 0.3 / 11, 1e-9);
  // 10 of 55 pairs have at least 2 degrees of error; the others have none.
  EXPECT_NEAR(e.auc[0], 45.0 / 55, 1e-9);
}

TEST(PoseEvaluation, ImagesThatAreNotRegisteredCountAsInfinite) {
  Rng rng(3);
  const PosedCameras reference = RandomCameras(6, rng);
  PosedCameras estimate = reference;
  estimate.erase("a/100.jpg");
  estimate["a/999.jpg"] = estimate["a/101.jpg"];
  const PoseEvaluation e = EvaluatePoses(estimate, reference);
  EXPECT_EQ(e.num_registered, 5);
  EXPECT_EQ(e.num_extra, 1);
  for (const double auc : e.auc) EXPECT_NEAR(auc, 10.0 / 15, 1e-12);
  EXPECT_FALSE(e.images[0].registered);
  EXPECT_FALSE(e.images[0].center);
  EXPECT_THAT(FormatPoseEvaluation(e), HasSubstr("not registered: a/100.jpg"));
}

TEST(PoseEvaluation, PosesThatAreNoNumbersAreWrong) {
  Rng rng(1);
  const PosedCameras reference = RandomCameras(9, rng);
  PosedCameras estimate = reference;
  estimate.begin()->second.cam_from_world.translation.x() =
      std::numeric_limits<double>::quiet_NaN();
  EXPECT_NEAR(EvaluatePoses(estimate, reference).auc[0], 28.0 / 36, 1e-12);  // pairs of the others
}

TEST(PoseEvaluation, FewOrNoImages) {
  Rng rng(4);
  const PosedCameras reference = RandomCameras(4, rng);
  PoseEvaluation e = EvaluatePoses({}, reference);
  EXPECT_EQ(e.num_registered, 0);
  EXPECT_EQ(e.auc[4], 0);
  EXPECT_FALSE(e.relative_rotation_median_deg);
  EXPECT_FALSE(e.center);
  EXPECT_FALSE(e.orientation_deg);
  EXPECT_FALSE(e.focal_relative);
  EXPECT_TRUE(nlohmann::json::parse(PoseEvaluationToJson(e))["center_med"].is_null());
  FormatPoseEvaluation(e);
  EXPECT_EQ(EvaluatePoses(reference, {}).num_extra, 4);
  PosedCameras two = {*reference.begin(), *std::next(reference.begin())};
  e = EvaluatePoses(two, reference);
  EXPECT_TRUE(e.relative_rotation_median_deg);
  EXPECT_FALSE(e.center);
  EXPECT_NEAR(e.auc[0], 1.0 / 6, 1e-12);
}

TEST(PoseEvaluation, NamesAreMatchedByTheLastPartWhereTheWholeFails) {
  Rng rng(5);
  const PosedCameras cameras = RandomCameras(2, rng);
  const auto& [first, second] = std::pair(cameras.begin()->second, cameras.rbegin()->second);
  const PosedCameras reference = {{"x/a.jpg", first}, {"b.jpg", second}};
  EXPECT_EQ(EvaluatePoses({{"y/z/a.jpg", first}, {"q/b.jpg", second}}, reference).num_registered,
            2);
  const PosedCameras estimate = {{"x/a.jpg", first}, {"z/a.jpg", second}, {"b.jpg", second}};
  const PoseEvaluation e = EvaluatePoses(estimate, reference);
  EXPECT_NEAR(e.auc[0], 1, 1e-12);  // x/a.jpg as it is, not z/a.jpg
}

TEST(PoseEvaluation, AnImageIsTheCounterpartOfOneAlone) {
  Rng rng(8);
  const PosedCameras cameras = RandomCameras(12, rng);
  PosedCameras rig, left, bare;
  int i = 0;
  for (const auto& [name, camera] : cameras) {
    const std::string frame = std::to_string(i / 2) + ".jpg";
    rig[(i % 2 == 0 ? "left/" : "right/") + frame] = camera;
    if (i++ % 2 != 0) continue;
    left["left/" + frame] = camera;
    bare[frame] = camera;
  }
  const PoseEvaluation e = EvaluatePoses(left, rig);
  EXPECT_EQ(e.num_registered, 6);
  EXPECT_EQ(e.num_extra, 0);
  EXPECT_LT(e.orientation_deg->mean, 1e-9);
  const PoseEvaluation swapped = EvaluatePoses(rig, left);
  EXPECT_EQ(swapped.num_registered, 6);
  EXPECT_EQ(swapped.num_extra, 6);
  // Of which of the two, nobody knows.
  EXPECT_EQ(EvaluatePoses(bare, rig).num_registered, 0);
  EXPECT_EQ(EvaluatePoses(rig, bare).num_registered, 0);
}

TEST(PoseEvaluation, FocalLengthsOfAnotherImageSizeAreScaled) {
  Rng rng(6);
  PosedCameras reference = RandomCameras(3, rng);
  PosedCameras estimate = reference;
  for (auto& [name, camera] : reference) {
    camera.width *= 2;
    camera.focal_px *= 2;
  }
  EXPECT_NEAR(EvaluatePoses(estimate, reference).focal_relative->mean, 0, 1e-15);
  reference.begin()->second.focal_px = 0;  // unknown
  EXPECT_EQ(EvaluatePoses(estimate, reference).focal_relative->count, 2);
}

TEST(PoseEvaluation, JsonHoldsWhatTheStructHolds) {
  Rng rng(7);
  const PosedCameras reference = RandomCameras(5, rng);
  PosedCameras estimate = reference;
  for (auto& [name, camera] : estimate) {
    camera.cam_from_world.translation += 0.01 * RandomCenter(rng);
    camera.focal_px += 1;
  }
  const PoseEvaluation e = EvaluatePoses(estimate, reference);
  const auto json = nlohmann::json::parse(PoseEvaluationToJson(e));
  EXPECT_EQ(json["registered"], 5);
  EXPECT_EQ(json["auc@1"].get<double>(), 100 * e.auc[0]);
  EXPECT_EQ(json["auc@20"].get<double>(), 100 * e.auc[4]);
  EXPECT_EQ(json["center_med"].get<double>(), e.center->median);
  EXPECT_EQ(json["center_med_rel"].get<double>(), e.center->median / *e.extent);
  EXPECT_EQ(json["focal_rel_mean"].get<double>(), e.focal_relative->mean);
  EXPECT_EQ(json["images"][2]["name"], "a/102.jpg");
}

}  // namespace
}  // namespace cairn
