#include "global_sfm/image_sizes.h"

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/image/bitmap.h"

namespace cairn {

void CompleteImageSizes(const std::string& image_path, Reconstruction& reconstruction) {
  for (auto& [id, image] : reconstruction.images) {
    Camera& camera = reconstruction.cameras.at(image.image.camera_id);
    if (camera.width > 0 && camera.height > 0) continue;
    if (image_path.empty()) {
      throw ConfigError("image_path",
                        "the model has no image sizes; give the folder of the photographs");
    }
    const ImageSize size = ReadImageSize(PathInFolder(image_path, image.image.name));
    camera.width = size.width;
    camera.height = size.height;
    const Eigen::Vector2d center(0.5 * size.width, 0.5 * size.height);
    camera.params[1] = center.x();  // RADIAL: f, cx, cy, k1, k2
    camera.params[2] = center.y();
    for (Eigen::Vector2d& point : image.points2D) point += center;
  }
}

}  // namespace cairn
