#include "cairn/synthetic/photos.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/depth/depth_map.h"
#include "cairn/image/exif.h"
#include "cairn/io/colmap_model.h"
#include "cairn/math/so3.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

PhotoOptions SmallOptions() {
  PhotoOptions options;
  options.layout = CameraLayout::kArc;
  options.num_images = 3;
  options.image_width = 200;
  options.image_height = 150;
  options.sensor_noise = 0;
  options.depth_noise = 0;
  options.depth_downscale = 1;
  return options;
}

// Of the surface points that image `a` shows: how many fall into image `b`, how many of them have
// the depth that image b shows there (the others are hidden), and how much these differ in colour.
struct Agreement {
  int num_in_both = 0;
  int num_same_depth = 0;
  double color_difference = 0;  // mean, gray levels
};

Agreement Compare(const PhotoScene& scene, int a, int b, const Rigid3d& b_from_a) {
  const Bitmap image_a = RenderPhoto(scene, a), image_b = RenderPhoto(scene, b);
  const DepthMap depth_a = RenderDepthMap(scene, a), depth_b = RenderDepthMap(scene, b);
  const Camera& camera_a = scene.truth.cameras.at(scene.images[a].camera_id);
  const Camera& camera_b = scene.truth.cameras.at(scene.images[b].camera_id);
  Agreement result;
  for (int y = 0; y < depth_a.height; y += 3) {
    for (int x = 0; x < depth_a.width; x += 3) {
      const double depth = depth_a.values[y * depth_a.width + x] / scene.depth_units[a];
      if (depth == 0) continue;
      const Eigen::Vector3d point =
          b_from_a * (depth * camera_a.CamFromImg({x + 0.5, y + 0.5})->homogeneous());
      const Eigen::Vector2d pixel = camera_b.ImgFromCam(point.hnormalized());
      if (point.z() <= 0 || pixel.minCoeff() < 0 || pixel.x() >= camera_b.width ||
          pixel.y() >= camera_b.height) {
        continue;
      }
      ++result.num_in_both;
      const int xb = static_cast<int>(pixel.x()), yb = static_cast<int>(pixel.y());
      const double depth_b_here = depth_b.values[yb * depth_b.width + xb] / scene.depth_units[b];
      if (std::abs(depth_b_here - point.z()) > 0.01 * point.z()) continue;
      ++result.num_same_depth;
      for (int k = 0; k < 3; ++k) {
        result.color_difference +=
            std::abs(image_a.Pixel(x, y)[k] - image_b.Pixel(xb, yb)[k]) / 3.0;
      }
    }
  }
  result.color_difference /= std::max(1, result.num_same_depth);
  return result;
}

TEST(Photos, ImagesShowTheSamePointsWithTheSameDepth) {
  for (const CameraModel model : {CameraModel::kSimplePinhole, CameraModel::kRadial}) {
    PhotoOptions options = SmallOptions();
    options.num_images = 8;
    options.camera_model = model;
    options.radial_distortion = -0.1;
    const PhotoScene scene = MakePhotoScene(options, 1);
    const Rigid3d b_from_a = scene.cam_from_world[3] * Inverse(scene.cam_from_world[2]);
    const Agreement agreement = Compare(scene, 2, 3, b_from_a);
    EXPECT_GT(agreement.num_same_depth, 0.6 * agreement.num_in_both) << CameraModelName(model);
    EXPECT_LT(agreement.color_difference, 15) << CameraModelName(model);
    const Rigid3d wrong = b_from_a * Rigid3d(ExpSO3({0, 0.05, 0}), Eigen::Vector3d::Zero());
    const Agreement broken = Compare(scene, 2, 3, wrong);
    EXPECT_GT(broken.color_difference, 1.5 * agreement.color_difference) << CameraModelName(model);
  }
}

TEST(Photos, TexturesAreRichAtFineAndCoarseScales) {
  const PhotoScene scene = MakePhotoScene(SmallOptions(), 2);
  const Bitmap image = RenderPhoto(scene, 1);
  // Mean difference of pixels 1 and 16 apart, over the lower two thirds (no sky).
  for (const int step : {1, 16}) {
    double difference = 0;
    int n = 0;
    for (int y = image.height / 3; y < image.height; ++y) {
      for (int x = 0; x + step < image.width; ++x, ++n) {
        difference += std::abs(image.Pixel(x, y)[1] - image.Pixel(x + step, y)[1]);
      }
    }
    EXPECT_GT(difference / n, step == 1 ? 5 : 15) << step;
  }
}

TEST(Photos, BytesDoNotDependOnThreads) {
  PhotoOptions options = SmallOptions();
  options.sensor_noise = 2;
  options.depth_noise = 0.05;
  const PhotoScene scene = MakePhotoScene(options, 3);
  EXPECT_EQ(RenderPhoto(scene, 1, 1).data, RenderPhoto(scene, 1, 8).data);
  EXPECT_EQ(RenderDepthMap(scene, 1, 1).values, RenderDepthMap(scene, 1, 8).values);
  EXPECT_NE(RenderPhoto(scene, 1).data, RenderPhoto(MakePhotoScene(options, 4), 1).data);
}

TEST(Photos, DepthNoiseIsAboutTheStatedDeviation) {
  PhotoOptions options = SmallOptions();
  options.num_images = 8;
  const PhotoScene exact = MakePhotoScene(options, 5);
  options.depth_noise = 0.05;
  const PhotoScene noisy = MakePhotoScene(options, 5);
  double sum = 0;
  int n = 0, num_sky = 0;
  for (int i = 0; i < 8; ++i) {
    const DepthMap a = RenderDepthMap(exact, i), b = RenderDepthMap(noisy, i);
    for (size_t k = 0; k < a.values.size(); ++k) {
      EXPECT_EQ(a.values[k] == 0, b.values[k] == 0);
      num_sky += a.values[k] == 0;
      if (a.values[k] == 0) continue;
      sum += std::pow(b.values[k] / a.values[k] - 1.0, 2);
      ++n;
    }
  }
  EXPECT_NEAR(std::sqrt(sum / n), 0.05, 0.02);
  EXPECT_GT(num_sky, 0);
}

TEST(Photos, DistractorsShowAnotherPlace) {
  PhotoOptions options = SmallOptions();
  options.num_distractor_images = 3;
  const PhotoScene scene = MakePhotoScene(options, 6);
  ASSERT_EQ(scene.images.size(), 6u);
  EXPECT_EQ(scene.truth.images.size(), 3u);
  const Rigid3d b_from_a = scene.cam_from_world[4] * Inverse(scene.cam_from_world[1]);
  const Agreement agreement = Compare(scene, 1, 4, b_from_a);
  EXPECT_LT(agreement.num_same_depth, 0.8 * agreement.num_in_both);
  EXPECT_GT(agreement.color_difference, 15);
}

TEST(Photos, EveryOptionHasAnEffect) {
  const std::vector<std::function<void(PhotoOptions&)>> changes = {
      [](PhotoOptions& o) { o.supersampling = 1; },
      [](PhotoOptions& o) { o.sensor_noise = 3; },
      [](PhotoOptions& o) { o.depth_noise = 0.1; },
      [](PhotoOptions& o) { o.depth_downscale = 2; },
  };
  const auto render = [](const PhotoOptions& options) {
    const PhotoScene scene = MakePhotoScene(options, 7);
    return std::pair(RenderPhoto(scene, 0).data, RenderDepthMap(scene, 0).values);
  };
  PhotoOptions options = SmallOptions();
  options.image_width = 80;
  options.image_height = 60;
  const auto reference = render(options);
  for (size_t i = 0; i < changes.size(); ++i) {
    PhotoOptions changed = options;
    changes[i](changed);
    EXPECT_NE(render(changed), reference) << "change " << i;
  }
  options.depth_downscale = 0;
  EXPECT_THROW(MakePhotoScene(options, 1), ConfigError);
}

TEST(Photos, WrittenFilesAreWhatTheProgramsRead) {
  const TempFolder folder;
  PhotoOptions options = SmallOptions();
  options.num_distractor_images = 1;
  const PhotoScene scene = MakePhotoScene(options, 8);
  WritePhotoScene(scene, folder / "scene", 0, NullMonitor());

  const Reconstruction truth = ReadColmapModel(folder / "scene/truth");
  ASSERT_EQ(truth.images.size(), 3u);
  for (const auto& [id, image] : truth.images) {
    EXPECT_EQ(image.image.name, scene.images[id - 1].name);
    EXPECT_LT((image.cam_from_world.Center() - scene.cam_from_world[id - 1].Center()).norm(),
              1e-12);
  }
  for (const Image& image : scene.images) {
    const Camera& camera = scene.truth.cameras.at(image.camera_id);
    const std::string path = folder / ("scene/images/" + image.name);
    const Bitmap bitmap = ReadBitmap(path, BitmapColor::kRgb);
    EXPECT_EQ(bitmap.width, camera.width);
    EXPECT_EQ(bitmap.height, camera.height);
    const ExifInfo exif = ReadExif(path, camera.width, camera.height);
    ASSERT_TRUE(exif.focal_px.has_value());
    EXPECT_NEAR(*exif.focal_px, camera.MeanFocal(), 1e-9);
    EXPECT_EQ(exif.camera_model, "synthetic camera " + std::to_string(image.camera_id));
  }
  const auto path = FindDepthMap(folder / "scene/depth", scene.images[1].name);
  ASSERT_TRUE(path.has_value());
  const DepthMap map = ReadDepthMap(*path, {});
  const DepthMap rendered = RenderDepthMap(scene, 1);
  EXPECT_EQ(map.width, rendered.width);
  EXPECT_EQ(map.values, rendered.values);
  EXPECT_LT(map.NumValid(), map.width * map.height);  // the sky has no depth
}

// To half a millimeter, which is what EXIF holds.
TEST(Photos, ExifHasTheFocalLengthThatIsAskedFor) {
  const TempFolder folder;
  PhotoOptions options = SmallOptions();
  options.focal_length = 2;
  const PhotoScene scene = MakePhotoScene(options, 8);
  WritePhotoScene(scene, folder / "scene", 0, NullMonitor());
  for (const Image& image : scene.images) {
    const Camera& camera = scene.truth.cameras.at(image.camera_id);
    const ExifInfo exif =
        ReadExif(folder / ("scene/images/" + image.name), camera.width, camera.height);
    EXPECT_NEAR(exif.focal_px.value_or(0) / camera.MeanFocal(), 1, 0.01);
  }
}

TEST(Photos, CamerasThatLookBehindThemselvesAreRefused) {
  PhotoOptions options;
  options.num_images = 2;
  options.camera_model = CameraModel::kEquirectangular;
  EXPECT_THROW(MakePhotoScene(options, 1), ConfigError);
  options.camera_model = CameraModel::kOpenCVFisheye;
  options.focal_length = 0.3;
  EXPECT_THROW(MakePhotoScene(options, 1), ConfigError);
  options.focal_length = 0.6;
  EXPECT_EQ(MakePhotoScene(options, 1).images.size(), 2u);
}

TEST(Photos, AFileInPlaceOfTheFolderIsAnError) {
  const TempFolder folder;
  WriteFileAtomically(folder / "scene", "a file");
  EXPECT_THROW(
      WritePhotoScene(MakePhotoScene(SmallOptions(), 8), folder / "scene", 0, NullMonitor()),
      IoError);
}

}  // namespace
}  // namespace cairn
