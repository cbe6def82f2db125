#include "cairn/image/resample.h"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "support/test.h"

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
  const Bitmap out = ResampleBitmap(bitmap, camera, CenteredPinhole(camera), Resampling::kCubic);
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

// The maps that OpenCV makes of its own camera models, which are in COLMAP's units but for the half
// pixel.
void ExpectAsOpenCv(const Camera& camera, const Camera& target, const cv::Mat& distortion) {
  Bitmap photo{camera.width, camera.height, 3, {}};
  Rng rng(1);
  for (int i = 0; i < 3 * camera.width * camera.height; ++i) {
    photo.data.push_back(static_cast<uint8_t>(rng.UniformInt(256)));
  }
  const auto matrix = [](const Camera& c) {
    return cv::Matx33d(c.FocalX(), 0, c.PrincipalPoint().x() - 0.5, 0, c.FocalY(),
                       c.PrincipalPoint().y() - 0.5, 0, 0, 1);
  };
  const cv::Size size(target.width, target.height);
  const cv::Matx33d R = cv::Matx33d::eye();
  cv::Mat map_x, map_y, expected;
  if (camera.model == CameraModel::kOpenCVFisheye) {
    cv::fisheye::initUndistortRectifyMap(matrix(camera), distortion, R, matrix(target), size,
                                         CV_32FC1, map_x, map_y);
  } else {
    cv::initUndistortRectifyMap(matrix(camera), distortion, R, matrix(target), size, CV_32FC1,
                                map_x, map_y);
  }
  cv::remap(cv::Mat(camera.height, camera.width, CV_8UC3, photo.data.data()), expected, map_x,
            map_y, cv::INTER_LINEAR);
  const Bitmap out = ResampleBitmap(photo, camera, target);
  int num_inside = 0, largest = 0, num_different = 0;
  for (int y = 0; y < target.height; ++y) {
    for (int x = 0; x < target.width; ++x) {
      const float at_x = map_x.at<float>(y, x), at_y = map_y.at<float>(y, x);
      if (!(at_x >= 0 && at_y >= 0 && at_x <= camera.width - 1 && at_y <= camera.height - 1)) {
        continue;
      }
      ++num_inside;
      for (int c = 0; c < 3; ++c) {
        const int difference = std::abs(out.Pixel(x, y)[c] - expected.at<cv::Vec3b>(y, x)[c]);
        largest = std::max(largest, difference);
        num_different += difference > 0;
      }
    }
  }
  EXPECT_GT(num_inside, 0.5 * target.width * target.height);
  EXPECT_LE(largest, 1);
  EXPECT_LT(num_different, 1e-3 * num_inside);
}

TEST(ResampleBitmap, AgreesWithOpenCvOnNoise) {
  Camera camera = MakeCamera(CameraModel::kOpenCV, {98, 102, 57, 47, -0.11, 0.02, 0.001, -0.002});
  camera.width = 640;
  camera.height = 480;
  for (const int i : {0, 1, 2, 3}) camera.params[i] *= 5.2;
  Camera target = camera;
  target.model = CameraModel::kPinhole;
  target.params.resize(4);
  ExpectAsOpenCv(camera, target, cv::Mat(cv::Matx14d(-0.11, 0.02, 0.001, -0.002)));
  camera.model = CameraModel::kOpenCVFisheye;
  camera.params = {260, 261, 322, 238, 0.03, -0.01, 0.002, 0.001};
  target.params = {260, 261, 400, 300};
  target.width = 800;
  target.height = 600;
  ExpectAsOpenCv(camera, target, cv::Mat(cv::Matx14d(0.03, -0.01, 0.002, 0.001)));
}

TEST(ResampleBitmap, IsBlackBeyondThePhotograph) {
  const Bitmap bitmap = MakeGradient(120, 90, 1);
  const Camera camera = MakeCamera(CameraModel::kPinhole, {100, 100, 60, 45});
  Camera target = camera;
  target.width = 130;
  target.params[2] = 70;  // ten columns to the left
  const Bitmap out = ResampleBitmap(bitmap, camera, target);
  EXPECT_EQ(*out.Pixel(9, 40), 0);
  EXPECT_EQ(*out.Pixel(10, 40), *bitmap.Pixel(0, 40));
}

// A fine checkerboard averages to gray, where reading single pixels would alias.
TEST(ResampleBitmap, AveragesWhereTheTargetIsCoarser) {
  Bitmap board{120, 90, 1, {}};
  for (int i = 0; i < 120 * 90; ++i) {
    board.data.push_back((i % 120 + i / 120) % 2 == 0 ? 0 : 200);
  }
  const Camera camera = MakeCamera(CameraModel::kSimpleRadial, {100, 60, 45, 0});
  Camera target = MakeCamera(CameraModel::kPinhole, {20, 20, 12, 9});
  target.width = 24;
  target.height = 18;
  const Bitmap out = ResampleBitmap(board, camera, target);
  for (int i = 0; i < 24 * 18; ++i) EXPECT_NEAR(out.data[i], 100, 5);
}

// Far off axis this model's radius shrinks again: no second image of the center is seen there.
TEST(ResampleBitmap, DistortionThatFoldsIsBlack) {
  const Bitmap white{120, 90, 1, std::vector<uint8_t>(120 * 90, 255)};
  const Camera camera = MakeCamera(CameraModel::kSimpleRadial, {100, 60, 45, -0.4});
  Camera target = MakeCamera(CameraModel::kPinhole, {100, 100, 200, 200});
  target.width = target.height = 400;
  const Bitmap out = ResampleBitmap(white, camera, target);
  EXPECT_EQ(*out.Pixel(200, 200), 255);
  EXPECT_EQ(*out.Pixel(200 + 155, 200), 0);  // 1.55: 1 - 0.4 * 1.55^2 = 0.04
  EXPECT_EQ(*out.Pixel(200 + 165, 200), 0);  // 1 - 0.4 * 1.65^2 = -0.09: on the other side
}

// The radius shrinks from a tangent of 1 to one of 1.41, and then grows again.
TEST(ResampleBitmap, BeyondAFoldNothingIsSeenAgain) {
  const Bitmap white{120, 90, 1, std::vector<uint8_t>(120 * 90, 255)};
  const Camera camera = MakeCamera(CameraModel::kRadial, {100, 60, 45, -0.5, 0.1});
  Camera target = MakeCamera(CameraModel::kPinhole, {100, 100, 200, 200});
  target.width = target.height = 400;
  const Bitmap out = ResampleBitmap(white, camera, target);
  EXPECT_EQ(*out.Pixel(200 + 90, 200), 255);
  for (int x = 102; x < 200; ++x) EXPECT_EQ(*out.Pixel(200 + x, 200), 0) << x;
}

TEST(ResampleBitmap, RefusesABitmapOfAnotherSize) {
  const Camera camera = MakeCamera(CameraModel::kSimplePinhole, {100, 60, 45});
  EXPECT_THROW(ResampleBitmap(MakeGradient(90, 120, 1), camera, camera), BugError);
}

}  // namespace
}  // namespace cairn
