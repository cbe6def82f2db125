#include "cairn/image/resample.h"

#include <gtest/gtest.h>

#include <cmath>

#include "cairn/base/error.h"

namespace cairn {
namespace {

// A smooth pattern, so that interpolation is nearly exact.
double Pattern(double x, double y) {
  return 128.0 + 60.0 * std::sin(0.11 * x) + 50.0 * std::cos(0.07 * y + 0.05 * x);
}

Bitmap MakeGradient(int width, int height, int channels) {
  Bitmap bitmap{.width = width, .height = height, .channels = channels, .data = {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        bitmap.data.push_back(
            static_cast<uint8_t>(std::lround(Pattern(x + 0.5 + 10 * c, y + 0.5))));
      }
    }
  }
  return bitmap;
}

Camera MakeCamera(CameraModel model, std::vector<double> params) {
  Camera camera;
  camera.camera_id = 3;
  camera.model = model;
  camera.width = 120;
  camera.height = 90;
  camera.params = std::move(params);
  return camera;
}

TEST(CenteredPinhole, KeepsSizeAndMeanFocal) {
  const Camera camera =
      CenteredPinhole(MakeCamera(CameraModel::kOpenCV, {98, 102, 50, 40, 0.1, 0, 0.01, 0}));
  EXPECT_EQ(camera.camera_id, 3u);
  EXPECT_EQ(camera.model, CameraModel::kSimplePinhole);
  EXPECT_EQ(camera.params, (std::vector<double>{100, 60, 45}));
}

TEST(ResampleBitmap, EqualCamerasGiveTheSameBytes) {
  const Bitmap bitmap = MakeGradient(120, 90, 3);
  const Camera camera = MakeCamera(CameraModel::kPinhole, {100, 100, 60, 45});
  EXPECT_EQ(ResampleBitmap(bitmap, camera, CenteredPinhole(camera)).data, bitmap.data);
}

TEST(ResampleBitmap, ShiftsByWholePixelsExactly) {
  const Bitmap bitmap = MakeGradient(120, 90, 1);
  const Camera camera = MakeCamera(CameraModel::kSimplePinhole, {100, 57, 47});
  const Bitmap out = ResampleBitmap(bitmap, camera, CenteredPinhole(camera));
  // Target pixel x shows what the source shows at x - 3, y + 2.
  EXPECT_EQ(*out.Pixel(50, 50), *bitmap.Pixel(47, 52));
  EXPECT_EQ(*out.Pixel(0, 10), *bitmap.Pixel(0, 12));  // beyond the border: its nearest pixel
  EXPECT_EQ(*out.Pixel(60, 89), *bitmap.Pixel(57, 89));
}

TEST(ResampleBitmap, ShowsEveryRayWhereResamplePixelSays) {
  const Bitmap bitmap = MakeGradient(120, 90, 3);
  const Camera camera =
      MakeCamera(CameraModel::kOpenCV, {99, 103, 57.3, 47.8, -0.12, 0.03, 0.002, -0.003});
  const Camera target = CenteredPinhole(camera);
  const Bitmap out = ResampleBitmap(bitmap, camera, target);
  for (int y = 15; y < 75; ++y) {
    for (int x = 15; x < 105; ++x) {
      const auto source = ResamplePixel({x + 0.5, y + 0.5}, target, camera);
      ASSERT_TRUE(source);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(out.Pixel(x, y)[c], Pattern(source->x() + 10 * c, source->y()), 1.5);
      }
      const auto back = ResamplePixel(*source, camera, target);
      ASSERT_TRUE(back);
      EXPECT_NEAR((*back - Eigen::Vector2d(x + 0.5, y + 0.5)).norm(), 0, 1e-8);
    }
  }
}

TEST(ResampleBitmap, RefusesABitmapOfAnotherSize) {
  const Camera camera = MakeCamera(CameraModel::kSimplePinhole, {100, 60, 45});
  EXPECT_THROW(ResampleBitmap(MakeGradient(90, 120, 1), camera, camera), BugError);
}

}  // namespace
}  // namespace cairn
