#include "cairn/base/error.h"
#include "cairn/image/resample.h"
#include "cairn/undistortion/undistort.h"
#include "support/test.h"

namespace cairn {
namespace {

Camera MakeCamera(CameraModel model, std::vector<double> params) {
  Camera camera;
  camera.camera_id = 7;
  camera.model = model;
  camera.width = 640;
  camera.height = 480;
  camera.params = std::move(params);
  return camera;
}

const Camera kBarrel = MakeCamera(CameraModel::kOpenCV, {500, 510, 330, 235, -0.2, 0.05, 1e-3, 0});
const Camera kPincushion = MakeCamera(CameraModel::kSimpleRadial, {500, 320, 240, 0.15});
const Camera kFisheye =
    MakeCamera(CameraModel::kOpenCVFisheye, {250, 250, 320, 240, 0.02, -0.01, 0, 0});

// Smallest distance by which the corners and sides of `from` lie inside `to`, pixels.
double Margin(const Camera& from, const Camera& to) {
  double margin = std::numeric_limits<double>::infinity();
  const auto look = [&](double x, double y) {
    const auto pixel = ResamplePixel({x, y}, from, to);
    if (!pixel) return;
    margin =
        std::min({margin, pixel->x(), pixel->y(), to.width - pixel->x(), to.height - pixel->y()});
  };
  for (int x = 0; x <= from.width; ++x) {
    look(x, 0);
    look(x, from.height);
  }
  for (int y = 0; y <= from.height; ++y) {
    look(0, y);
    look(from.width, y);
  }
  return margin;
}

TEST(UndistortedCamera, APinholeCameraStaysAsItIs) {
  const Camera camera = MakeCamera(CameraModel::kPinhole, {500, 510, 330, 235});
  for (const double blank_pixels : {0.0, 0.4, 1.0}) {
    const Camera same = UndistortedCamera(camera, {.blank_pixels = blank_pixels});
    EXPECT_EQ(same.params, camera.params);
    EXPECT_EQ(same.width, 640);
    EXPECT_EQ(same.height, 480);
    EXPECT_EQ(same.camera_id, 7u);
  }
}

TEST(UndistortedCamera, CropsToWhatThePhotographFills) {
  for (const Camera& camera : {kBarrel, kPincushion, kFisheye}) {
    const Camera pinhole = UndistortedCamera(camera, {});
    EXPECT_EQ(pinhole.model, CameraModel::kPinhole);
    EXPECT_EQ(pinhole.FocalX(), camera.FocalX());
    EXPECT_EQ(pinhole.FocalY(), camera.FocalY());
    const double margin = Margin(pinhole, camera);
    EXPECT_GT(margin, -1e-6);
    EXPECT_LT(margin, 1.5);  // sizes are whole pixels
  }
}

// Where distortion folds within the photograph, its sides or its corners have no undistorted pixel.
TEST(UndistortedCamera, CropsToWhatIsNotFoldedOver) {
  for (const double k : {-0.22, -0.3, -0.45}) {
    const Camera camera = MakeCamera(CameraModel::kSimpleRadial, {350, 320, 240, k});
    const double fold = 350 / std::sqrt(-3 * k);  // px from the center
    for (const bool center : {false, true}) {
      const Camera pinhole = UndistortedCamera(camera, {.center_principal_point = center});
      const double corner = 0.5 * std::hypot(pinhole.width, pinhole.height);
      EXPECT_LT(corner, fold + 1);
      EXPECT_GT(corner, fold - 3);
    }
  }
}

// What a wide photograph shows once more beyond the fold fills nothing.
TEST(UndistortedCamera, EndsBeforeTheFold) {
  Camera camera = MakeCamera(CameraModel::kSimpleRadial, {30, 100, 100, -0.5});
  camera.width = camera.height = 200;
  const Camera pinhole = UndistortedCamera(camera, {.min_scale = 0.01});
  const double corner = 0.5 * std::hypot(pinhole.width, pinhole.height);
  EXPECT_LT(corner / pinhole.MeanFocal(), 1 / std::sqrt(3 * 0.5) + 0.05);
}

TEST(UndistortedCamera, KeepsTheWholePhotograph) {
  for (const Camera& camera : {kBarrel, kPincushion}) {
    const Camera pinhole = UndistortedCamera(camera, {.blank_pixels = 1});
    const double margin = Margin(camera, pinhole);
    EXPECT_GT(margin, -2);
    EXPECT_LT(margin, 1);
    const Camera between = UndistortedCamera(camera, {.blank_pixels = 0.5});
    EXPECT_LT(between.width, pinhole.width);
    EXPECT_GT(between.width, UndistortedCamera(camera, {}).width);
  }
}

TEST(UndistortedCamera, CentersThePrincipalPoint) {
  // By 20 and 15 px off: the image loses twice as much.
  const Camera off = MakeCamera(CameraModel::kPinhole, {500, 510, 340, 225});
  const Camera cropped = UndistortedCamera(off, {.center_principal_point = true});
  EXPECT_EQ(cropped.params, (std::vector<double>{500, 510, 300, 225}));
  EXPECT_EQ(cropped.width, 600);
  EXPECT_EQ(cropped.height, 450);
  const Camera whole = UndistortedCamera(off, {.blank_pixels = 1, .center_principal_point = true});
  EXPECT_EQ(whole.params, (std::vector<double>{500, 510, 340, 255}));
  const Camera barrel = MakeCamera(CameraModel::kSimpleRadial, {500, 335, 230, -0.1});
  const Camera pinhole = UndistortedCamera(barrel, {.center_principal_point = true});
  EXPECT_EQ(pinhole.PrincipalPoint(), Eigen::Vector2d(pinhole.width, pinhole.height) / 2);
  const double margin = Margin(pinhole, barrel);
  EXPECT_GT(margin, -1e-6);
  EXPECT_LT(margin, 1.5);
  const Camera reduced =
      UndistortedCamera(barrel, {.max_image_size = 100, .center_principal_point = true});
  EXPECT_EQ(reduced.PrincipalPoint(), Eigen::Vector2d(reduced.width, reduced.height) / 2);
}

TEST(UndistortedCamera, LimitsHold) {
  const Camera wide = MakeCamera(CameraModel::kFisheye, {150, 150, 320, 240});  // 244 degrees
  const Camera largest = UndistortedCamera(wide, {.blank_pixels = 1, .max_scale = 1.5});
  EXPECT_EQ(largest.width, 960);
  EXPECT_EQ(largest.height, 720);
  EXPECT_EQ(largest.params, (std::vector<double>{150, 150, 480, 360}));
  const Camera smallest = UndistortedCamera(kBarrel, {.min_scale = 1.2});
  EXPECT_EQ(smallest.width, 768);
  const Camera reduced = UndistortedCamera(kBarrel, {.max_image_size = 100});
  EXPECT_EQ(reduced.width, 100);
  EXPECT_NEAR(reduced.FocalX() / kBarrel.FocalX(), 100.0 / UndistortedCamera(kBarrel, {}).width,
              1e-12);
  EXPECT_THROW(UndistortedCamera(kBarrel, {.min_scale = 2, .max_scale = 1}), ConfigError);
  const Camera panorama = Camera::FromFocal(1, CameraModel::kEquirectangular, 1, 640, 320);
  EXPECT_THROW(UndistortedCamera(panorama, {}), ConfigError);
}

TEST(UndistortedCamera, APrincipalPointBeyondTheImageIsNoTrouble) {
  const Camera camera = MakeCamera(CameraModel::kSimpleRadial, {500, -40, 240, 0.01});
  const Camera pinhole = UndistortedCamera(camera, {});
  EXPECT_EQ(pinhole.Validate(), "");
  EXPECT_NEAR(pinhole.width, 640, 30);
}

}  // namespace
}  // namespace cairn
