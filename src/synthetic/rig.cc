#include "cairn/synthetic/rig.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"

namespace cairn {
namespace {

// Of the first images, so many have a camera of their own.
int NumOwnCameras(const RigOptions& options, int num_images) {
  return static_cast<int>(options.own_camera_share * num_images);
}

}  // namespace

void RigOptions::VisitFields(OptionVisitor& v) {
  v.Choice("layout", layout, kCameraLayouts, "how the cameras stand around the scene");
  v.Int("num_images", num_images, {1, 1e6}, "images of the scene");
  v.Int("num_distractor_images", num_distractor_images, {0, 1e6}, "images of another place");
  v.Int("num_cameras", num_cameras, {1, 1000}, "cameras of different focal length");
  v.Double("own_camera_share", own_camera_share, {0, 1},
           "share of the images that have a camera of their own");
  v.Choice("camera_model", camera_model, NamedCameraModels(), "camera model");
  v.Double("radial_distortion", radial_distortion, {-0.3, 0.3},
           "first radial coefficient, where the model has one");
  v.Double("focal_length", focal_length, {0, 100},
           "focal length in units of the larger side; 0: those of 36 mm to 56 mm lenses");
  v.Int("image_width", image_width, {16, 20000},
        "pixels; every second camera has four fifths of it");
  v.Int("image_height", image_height, {16, 20000},
        "pixels; every second camera has four fifths of it");
  v.Double("distance", distance, {1.5, 100.0}, "of the cameras; the scene's radius is 1");
}

int FocalLength35mm(const RigOptions& options, int camera_index) {
  if (options.focal_length > 0) {
    const double larger = std::max(options.image_width, options.image_height);
    const double diagonal = std::hypot(options.image_width, options.image_height);
    return static_cast<int>(std::lround(43.27 * options.focal_length * larger / diagonal));
  }
  constexpr int kNumDifferent = 21;
  if (camera_index >= options.num_cameras) return 36 + (8 * camera_index) % kNumDifferent;
  if (options.num_cameras == 1) return 40;
  return static_cast<int>(std::lround(36.0 + 20.0 * camera_index / (options.num_cameras - 1)));
}

std::map<camera_t, Camera> MakeCameras(const RigOptions& options) {
  std::map<camera_t, Camera> cameras;
  const int num_images = options.num_images + options.num_distractor_images;
  const int num_cameras = options.num_cameras + NumOwnCameras(options, num_images);
  for (int i = 0; i < num_cameras; ++i) {
    const double size = i % 2 == 0 ? 1.0 : 0.8;
    const int width = static_cast<int>(std::lround(size * options.image_width));
    const int height = static_cast<int>(std::lround(size * options.image_height));
    const double focal_px = options.focal_length > 0
                                ? options.focal_length * std::max(width, height)
                                : FocalLength35mm(options, i) / 43.27 * std::hypot(width, height);
    Camera camera = Camera::FromFocal(i + 1, options.camera_model, focal_px, width, height);
    const std::vector<int> distortion = camera.DistortionIndices();
    if (!distortion.empty()) camera.params[distortion[0]] = options.radial_distortion;
    camera.has_prior_focal_length = true;
    cameras.emplace(i + 1, camera);
  }
  return cameras;
}

std::vector<Image> MakeImages(const RigOptions& options) {
  std::vector<Image> images;
  for (int i = 0; i < options.num_images + options.num_distractor_images; ++i) {
    const bool is_distractor = i >= options.num_images;
    const std::string name = Formatted(is_distractor ? "other%05d.jpg" : "image%05d.jpg",
                                       is_distractor ? i - options.num_images : i);
    const int num_own = NumOwnCameras(options, i + 1);
    const bool is_own = num_own > NumOwnCameras(options, i);
    const int camera = is_own ? options.num_cameras + num_own : 1 + i % options.num_cameras;
    images.push_back({static_cast<image_t>(i + 1), name, static_cast<camera_t>(camera)});
  }
  return images;
}

}  // namespace cairn
