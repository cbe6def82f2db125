#include "cairn/scene/reconstruction.h"

#include <cmath>
#include <functional>
#include <limits>

#include "cairn/base/error.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/scene.h"
#include "support/check_consistency.h"
#include "support/test.h"

namespace cairn {
namespace {

Reconstruction MakeSmall() {
  SceneOptions options;
  options.num_images = 5;
  options.num_points = 200;
  options.layout = CameraLayout::kArc;
  options.image_noise_px = 1.0;
  return MakeScene(options, 1).truth;
}

int64_t NumReferences(const Reconstruction& reconstruction) {
  int64_t n = 0;
  for (const auto& [id, image] : reconstruction.images) {
    for (const point3D_t point : image.point3D_ids) n += point != kInvalidPoint3DId;
  }
  return n;
}

TEST(Reconstruction, AddAndRemovePointsKeepBothSides) {
  Reconstruction r = MakeSmall();
  CheckConsistency(r);
  EXPECT_EQ(NumReferences(r), r.NumObservations());
  EXPECT_DOUBLE_EQ(r.MeanTrackLength(), double(r.NumObservations()) / r.points3D.size());

  const auto [old_id, old_point] = *r.points3D.begin();
  const int64_t before = r.NumObservations();
  r.RemovePoint3D(old_id);
  CheckConsistency(r);
  EXPECT_EQ(r.NumObservations(), before - static_cast<int64_t>(old_point.track.size()));
  const point3D_t new_id = r.AddPoint3D(old_point);
  CheckConsistency(r);
  EXPECT_EQ(r.NumObservations(), before);
  EXPECT_EQ(new_id, r.points3D.rbegin()->first);
  EXPECT_EQ(NumReferences(r), before);
  EXPECT_THROW(r.RemovePoint3D(123456789), BugError);
}

TEST(Reconstruction, AKeypointShowsOnePointOnly) {
  Reconstruction r = MakeSmall();
  const Point3D point = r.points3D.begin()->second;
  EXPECT_THROW(r.AddPoint3D(point), BugError);
  CheckConsistency(r);  // nothing was changed
}

TEST(Reconstruction, RemoveObservationDropsShortTracks) {
  Reconstruction r = MakeSmall();
  for (const auto& [id, point] : std::map(r.points3D)) {
    Track rest = point.track;
    while (r.points3D.count(id)) {
      const TrackElement element = rest.back();
      rest.pop_back();
      r.RemoveObservation(id, element);
      EXPECT_EQ(r.images.at(element.image_id).point3D_ids[element.point2D], kInvalidPoint3DId);
    }
    EXPECT_LE(rest.size(), 1u);
  }
  CheckConsistency(r);
  EXPECT_EQ(NumReferences(r), 0);
}

TEST(Reconstruction, ErrorsAreMeansOverObservationsThenOverPoints) {
  Reconstruction r = MakeSmall();
  r.UpdatePointErrors();
  double sum = 0;
  for (const auto& [id, point] : r.points3D) {
    double expected = 0;
    for (const TrackElement& e : point.track) {
      const RegisteredImage& image = r.images.at(e.image_id);
      const Eigen::Vector3d x = image.cam_from_world * point.xyz;
      expected +=
          (r.CameraOf(image).ImgFromCam(x.hnormalized()) - image.points2D[e.point2D]).norm();
    }
    EXPECT_NEAR(point.error_px * point.track.size(), expected, 1e-9);
    sum += point.error_px;
  }
  EXPECT_NEAR(r.MeanReprojectionErrorPx(), sum / static_cast<double>(r.points3D.size()), 1e-12);
}

TEST(Reconstruction, APointThatNobodySeesHasNoError) {
  Reconstruction r = MakeSmall();
  const double before = r.MeanReprojectionErrorPx();
  r.points3D[1000].xyz = {1, 2, 3};
  EXPECT_EQ(r.MeanReprojectionErrorPx(), before);
  r.UpdatePointErrors();
  EXPECT_EQ(r.points3D.at(1000).error_px, -1);
}

TEST(Reconstruction, BehindTheCameraIsInfinite) {
  const Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, 100, 200, 200);
  EXPECT_EQ(ReprojectionErrorPx(camera, {}, {0, 0, -1}, {100, 100}),
            std::numeric_limits<double>::infinity());
  EXPECT_EQ(ReprojectionErrorPx(camera, {}, {0, 0, 0}, {100, 100}),
            std::numeric_limits<double>::infinity());
  EXPECT_NEAR(ReprojectionErrorPx(camera, {}, {0.3, 0.4, 10}, {100, 100}), 5, 1e-12);
}

// A model whose points nobody sees is not perfect.
TEST(Reconstruction, WhereNothingReprojectsTheMeanIsInfinite) {
  Reconstruction r = MakeSmall();
  EXPECT_LT(r.MeanReprojectionErrorPx(), 2);
  for (auto& [id, image] : r.images) {
    image.cam_from_world = Rigid3d(ExpSO3({0, M_PI, 0}), {0, 0, 0}) * image.cam_from_world;
  }
  EXPECT_EQ(r.MeanReprojectionErrorPx(), std::numeric_limits<double>::infinity());
  EXPECT_EQ(Reconstruction().MeanReprojectionErrorPx(), 0);
}

// A panorama closes where its picture ends.
TEST(Reconstruction, ErrorsGoTheShortWayAcrossTheSeamOfAPanorama) {
  const Camera camera = Camera::FromFocal(1, CameraModel::kEquirectangular, 1, 4000, 2000);
  const Eigen::Vector3d point = camera.RayFromImg({3999.7, 900}).value();
  EXPECT_NEAR(ReprojectionErrorPx(camera, Rigid3d(), point, {0.4, 900}), 0.7, 1e-6);
  EXPECT_NEAR(ReprojectionErrorPx(camera, Rigid3d(), point, {3999, 900}), 0.7, 1e-6);
}

TEST(Reconstruction, ASimilarityChangesNoReprojection) {
  Reconstruction r = MakeSmall();
  const double before = r.MeanReprojectionErrorPx();
  const Sim3d new_from_old{2.5, ExpSO3({0.4, -1.0, 0.3}), {10, -20, 30}};
  const Eigen::Vector3d center = r.images.at(1).cam_from_world.Center();
  r.Transform(new_from_old);
  EXPECT_NEAR(r.MeanReprojectionErrorPx(), before, 1e-10);
  EXPECT_LT((r.images.at(1).cam_from_world.Center() - new_from_old * center).norm(), 1e-12);
  CheckConsistency(r);
}

TEST(Reconstruction, CheckConsistencyFindsEachDefect) {
  using Defect = std::function<void(Reconstruction&)>;
  const std::vector<Defect> defects = {
      [](Reconstruction& r) { r.cameras.erase(1); },
      [](Reconstruction& r) { r.images.at(1).image.image_id = 7; },
      [](Reconstruction& r) { r.images.at(1).points2D.pop_back(); },
      [](Reconstruction& r) { r.images.at(2).cam_from_world.translation.x() = std::nan(""); },
      [](Reconstruction& r) { r.images.at(2).cam_from_world.rotation.x() = std::nan(""); },
      [](Reconstruction& r) { r.points3D.begin()->second.xyz.z() = std::nan(""); },
      [](Reconstruction& r) { r.points3D.begin()->second.track.resize(1); },
      [](Reconstruction& r) { r.points3D.begin()->second.track[0].point2D += 1; },
      [](Reconstruction& r) { r.points3D.erase(r.points3D.begin()); },
      [](Reconstruction& r) { r.images.erase(3); },
      [](Reconstruction& r) {
        Track& track = r.points3D.begin()->second.track;
        std::swap(track.front(), track.back());
      },
  };
  for (size_t i = 0; i < defects.size(); ++i) {
    Reconstruction r = MakeSmall();
    defects[i](r);
    EXPECT_ANY_THROW(CheckConsistency(r)) << "defect " << i;
  }
}

TEST(Reconstruction, EmptyIsFine) {
  Reconstruction r;
  CheckConsistency(r);
  EXPECT_EQ(r.MeanTrackLength(), 0);
  EXPECT_EQ(r.MeanReprojectionErrorPx(), 0);
  EXPECT_EQ(r.NumObservations(), 0);
  r.Transform({});
}

}  // namespace
}  // namespace cairn
