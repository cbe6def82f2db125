#include <algorithm>
#include <cmath>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/image/bitmap.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Of a photograph whose colors are read: a keypoint has several pixels of the whole one.
constexpr int kMinLongerSide = 1500;
// Relative difference of the sides' ratio: sizes are rounded.
constexpr double kMaxShape = 0.02;

// RGB at every keypoint of an image that shows a point.
struct ImageColors {
  std::vector<std::pair<point3D_t, std::array<uint8_t, 3>>> colors;
  std::string error;
};

ImageColors ReadColors(const std::string& folder, const Camera& camera,
                       const RegisteredImage& image) {
  ImageColors result;
  Bitmap bitmap;
  try {
    bitmap = ReadReducedBitmap(PathInFolder(folder, image.image.name), BitmapColor::kRgb,
                               kMinLongerSide);
  } catch (const IoError& error) {
    result.error = error.what();
    return result;
  }
  // The file may be stored at another size than the one that was matched, too.
  const double scale_x = static_cast<double>(bitmap.width) / camera.width;
  const double scale_y = static_cast<double>(bitmap.height) / camera.height;
  if (std::abs(std::log(scale_x / scale_y)) > kMaxShape) {
    result.error = PathInFolder(folder, image.image.name) +
                   ": has another shape than its camera, " + std::to_string(camera.width) + " x " +
                   std::to_string(camera.height);
    return result;
  }
  for (size_t i = 0; i < image.points2D.size(); ++i) {
    if (image.point3D_ids[i] == kInvalidPoint3DId) continue;
    const int x =
        std::clamp(static_cast<int>(scale_x * image.points2D[i].x()), 0, bitmap.width - 1);
    const int y =
        std::clamp(static_cast<int>(scale_y * image.points2D[i].y()), 0, bitmap.height - 1);
    const uint8_t* rgb = bitmap.Pixel(x, y);
    result.colors.push_back({image.point3D_ids[i], {rgb[0], rgb[1], rgb[2]}});
  }
  return result;
}

}  // namespace

std::vector<std::string> ColorPoints(StageContext& context, const std::string& image_path,
                                     Reconstruction& model) {
  ModelStage stage(context, "colors", static_cast<int64_t>(model.images.size()));
  std::vector<const RegisteredImage*> images;
  for (const auto& [id, image] : model.images) images.push_back(&image);
  std::vector<ImageColors> colors(images.size());
  ParallelFor(context.run.num_threads, static_cast<int64_t>(images.size()), [&](int64_t i) {
    colors[i] = ReadColors(image_path, model.CameraOf(*images[i]), *images[i]);
    context.run.monitor.Advance(1);
  });
  // Sums of color and number of views of every point.
  const point3D_t end = model.points3D.empty() ? 0 : model.points3D.rbegin()->first + 1;
  std::vector<std::array<int, 4>> sums(end);  // by point
  std::vector<std::string> skipped;
  for (const ImageColors& image : colors) {
    if (!image.error.empty()) skipped.push_back(image.error + "; its colors are left out");
    for (const auto& [point, rgb] : image.colors) {
      std::array<int, 4>& sum = sums[point];
      for (int k = 0; k < 3; ++k) sum[k] += rgb[k];
      ++sum[3];
    }
  }
  size_t num_colored = 0;
  for (auto& [id, point] : model.points3D) {
    const std::array<int, 4>& sum = sums[id];
    if (sum[3] == 0) continue;
    ++num_colored;
    for (int k = 0; k < 3; ++k) {
      point.color[k] = static_cast<uint8_t>((sum[k] + sum[3] / 2) / sum[3]);
    }
  }
  stage.WarnEach(skipped);
  stage.Add("images_read", images.size() - skipped.size());
  stage.Add("points_colored", num_colored);
  return skipped;
}

}  // namespace cairn
