#include "intrinsics/known_intrinsics.h"

#include "support/test.h"

namespace cairn {
namespace {

Camera GuessedCamera(camera_t id) {
  return Camera::FromFocal(id, CameraModel::kOpenCV, 900, 1001, 800);
}

TEST(LooksMeasured, IfNeitherExifNorAGuessGivesTheIntrinsics) {
  EXPECT_FALSE(LooksMeasured(GuessedCamera(1)));
  for (const auto& [index, change] : {std::pair(3, 3.0), {1, 1.0}, {4, -0.01}}) {
    Camera camera = GuessedCamera(1);
    camera.params[index] += change;  // principal point, second focal length, distortion
    EXPECT_TRUE(LooksMeasured(camera)) << index;
  }
}

TEST(LooksMeasured, NotAFieldOfViewOfAngleZero) {
  Camera camera = Camera::FromFocal(1, CameraModel::kFov, 900, 1001, 800);
  EXPECT_FALSE(LooksMeasured(camera));
  camera.params[4] = 0;
  EXPECT_FALSE(LooksMeasured(camera));
  camera.params[4] = 0.9;
  EXPECT_TRUE(LooksMeasured(camera));
}

TEST(IsCentered, WhereTheCenterOfAnOddSizeIsRoundedDown) {
  Camera camera = GuessedCamera(1);
  EXPECT_TRUE(IsCentered(camera));
  camera.params[2] = 500;  // of 1001
  EXPECT_TRUE(IsCentered(camera));
  EXPECT_FALSE(LooksMeasured(camera));
  camera.params[2] = 501.5;
  EXPECT_FALSE(IsCentered(camera));
}

class KnownIntrinsicsTest : public ::testing::Test {
 protected:
  KnownIntrinsics Read() const { return ReadKnownIntrinsics(database_).at(1); }

  Database database_{":memory:"};
};

TEST_F(KnownIntrinsicsTest, GivenOnesAreConstant) {
  database_.WriteCamera(GuessedCamera(1));
  EXPECT_FALSE(Read().IsConstant());
  database_.WriteStage({"cameras", "camera_model = \"PINHOLE\"\ncamera_params = []\n", true});
  EXPECT_FALSE(Read().IsConstant());
  database_.WriteStage({"cameras", "camera_params = [1.0, 2.0]\n", true});
  EXPECT_TRUE(Read().IsConstant());
}

TEST_F(KnownIntrinsicsTest, MeasuredOnesAreConstantUnlessTheirPairsContradictThem) {
  Camera camera = GuessedCamera(1);
  camera.params[2] += 5;
  camera.has_prior_focal_length = true;
  database_.WriteCamera(camera);
  EXPECT_TRUE(Read().IsConstant());
  EXPECT_TRUE(Read().IsFocalTrusted());
  database_.WriteCameraFocals({{1, {false, 8, 1}}});
  EXPECT_TRUE(Read().IsConstant());
  database_.WriteCameraFocals({{1, {true, 8, 7}}});
  EXPECT_FALSE(Read().IsConstant());
  EXPECT_FALSE(Read().IsFocalTrusted());
  EXPECT_TRUE(Read().camera.has_prior_focal_length);
}

// As after another program changed the camera.
TEST_F(KnownIntrinsicsTest, LearnedDistortionIsNotOfAModelWithoutAny) {
  database_.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 900, 1001, 800));
  database_.WriteCameraLens(1, {.focal_px = 1200, .focal_sigma = 0.02, .k = -0.05, .num_pairs = 9});
  EXPECT_EQ(Read().camera.params, std::vector<double>({1200, 1200, 500.5, 400}));
}

TEST_F(KnownIntrinsicsTest, LearnedOnesAreNotConstantAndTrustedIfSure) {
  database_.WriteCamera(GuessedCamera(1));
  EXPECT_FALSE(Read().IsFocalTrusted());
  database_.WriteCameraLens(1, {.focal_px = 1200, .focal_sigma = 0.2, .k = -0.05, .num_pairs = 9});
  EXPECT_FALSE(Read().IsFocalTrusted());
  database_.WriteCameraLens(
      1,
      {.focal_px = 1100, .focal_sigma = 0.02, .is_focal_known = true, .k = -0.04, .num_pairs = 9});
  const KnownIntrinsics known = Read();
  EXPECT_TRUE(known.IsFocalTrusted());
  EXPECT_TRUE(known.HasLearned());
  EXPECT_FALSE(known.IsConstant());
  EXPECT_DOUBLE_EQ(known.camera.MeanFocal(), 1100);
  EXPECT_DOUBLE_EQ(known.camera.params[known.camera.DistortionIndices()[0]], -0.04);
}

}  // namespace
}  // namespace cairn
