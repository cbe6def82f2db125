#include "cairn/undistortion/undistort.h"
#include "support/check_consistency.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"

namespace cairn {
namespace {

std::set<std::string> NamesOf(const Reconstruction& model) {
  std::set<std::string> names;
  for (const auto& [id, image] : model.images) names.insert(image.image.name);
  return names;
}

// Exact keypoints of a scene, seen by cameras of every model that has a pinhole image.
TEST(UndistortedModel, PointsAreWhereTheUndistortedCameraSeesThem) {
  for (int id = 0; id < kNumCameraModels; ++id) {
    const auto camera_model = static_cast<CameraModel>(id);
    if (camera_model == CameraModel::kEquirectangular) continue;
    const Reconstruction model =
        MakeSyntheticScene({.model = camera_model, .shared_camera = false}).truth;
    const Reconstruction out = UndistortedModel(model, NamesOf(model), {});
    CheckConsistency(out);
    EXPECT_EQ(out.NumObservations(), model.NumObservations());
    double largest = 0;
    for (const auto& [point_id, point] : out.points3D) {
      EXPECT_EQ(point.xyz, model.points3D.at(point_id).xyz);
      for (const TrackElement& element : point.track) {
        const RegisteredImage& image = out.images.at(element.image_id);
        EXPECT_EQ(out.CameraOf(image).model, CameraModel::kPinhole);
        largest =
            std::max(largest, ReprojectionErrorPx(out.CameraOf(image), image.cam_from_world,
                                                  point.xyz, image.points2D[element.point2D]));
      }
    }
    EXPECT_LT(largest, 1e-6) << CameraModelName(camera_model);
  }
}

TEST(UndistortedModel, LeavesOutWhatHasNoImage) {
  Reconstruction model = MakeSyntheticScene({.shared_camera = false}).truth;
  std::set<std::string> names = NamesOf(model);
  names.erase("image3");
  const Reconstruction out = UndistortedModel(model, names, {});
  CheckConsistency(out);
  EXPECT_EQ(out.images.size(), 5u);
  EXPECT_EQ(out.cameras.count(3), 0u);
  EXPECT_EQ(out.images.count(3), 0u);
}

TEST(UndistortedModel, LeavesOutKeypointsWithoutAPinholePixel) {
  Reconstruction model = MakeSyntheticScene({.model = CameraModel::kFisheye}).truth;
  const point3D_t id = model.points3D.begin()->first;
  const TrackElement element = model.points3D.at(id).track.front();
  // 103 degrees off axis: behind every pinhole image.
  model.images.at(element.image_id).points2D[element.point2D] =
      model.cameras.at(1).PrincipalPoint() + Eigen::Vector2d(1.8 * model.cameras.at(1).FocalX(), 0);
  const Reconstruction out = UndistortedModel(model, NamesOf(model), {});
  CheckConsistency(out);
  EXPECT_EQ(out.NumObservations(), model.NumObservations() - 1);
  EXPECT_EQ(out.images.at(element.image_id).points2D.size(),
            model.images.at(element.image_id).points2D.size() - 1);
}

}  // namespace
}  // namespace cairn
