#include "cairn/synthetic/photos.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/base/rng.h"
#include "cairn/image/exif.h"
#include "cairn/io/colmap_model.h"
#include "cairn/synthetic/poses.h"
#include "synthetic/world.h"

namespace cairn {
namespace {

constexpr int kTileSize = 32;  // pixels; candidates for a ray are found once a tile

bool IsDistractor(const PhotoScene& scene, int index) { return index >= scene.options.num_images; }

World MakeWorld(const PhotoScene& scene, int index) {
  return World(Rng(scene.seed, "photo_place", IsDistractor(scene, index)).NextU64());
}

const Camera& CameraOf(const PhotoScene& scene, int index) {
  return scene.truth.cameras.at(scene.images[index].camera_id);
}

// Rays of one image in its world; their direction has z-depth 1, so that a hit's t is its depth.
class RayCaster {
 public:
  RayCaster(const PhotoScene& scene, int index)
      : world_(MakeWorld(scene, index)),
        camera_(CameraOf(scene, index)),
        world_from_cam_(scene.cam_from_world[index].RotationMatrix().transpose()),
        center_(scene.cam_from_world[index].Center()) {}

  const World& world() const { return world_; }

  Ray At(double x, double y) const {
    const auto uv = camera_.CamFromImg({x, y});
    CAIRN_CHECK(uv.has_value());
    return {center_, world_from_cam_ * uv->homogeneous()};
  }

  // Solids that any ray through the rectangle may hit.
  std::vector<int> Candidates(double x0, double y0, double x1, double y1) const {
    const Eigen::Vector3d axis = At(0.5 * (x0 + x1), 0.5 * (y0 + y1)).direction.normalized();
    double radius = 0;
    for (const double x : {x0, x1}) {
      for (const double y : {y0, y1}) {
        radius = std::max(radius, AngleBetween(axis, At(x, y).direction));
      }
    }
    return world_.SolidsInCone(center_, axis, 1.05 * radius);
  }

  // Size of a pixel on the surface that was hit, world units.
  double Footprint(const Ray& ray, const Hit& hit) const {
    const double cosine = std::abs(hit.normal.dot(ray.direction)) / ray.direction.norm();
    return hit.t / camera_.MeanFocal() / std::max(cosine, 0.1);
  }

 private:
  const World world_;
  const Camera& camera_;
  Eigen::Matrix3d world_from_cam_;
  Eigen::Vector3d center_;
};

// Calls fn(x0, y0, x1, y1) for every tile of a width x height grid.
template <class Function>
void ForEachTile(int num_threads, int width, int height, const Function& fn) {
  const int columns = (width + kTileSize - 1) / kTileSize;
  const int rows = (height + kTileSize - 1) / kTileSize;
  ParallelFor(num_threads, static_cast<int64_t>(columns) * rows, [&](int64_t tile) {
    const int x0 = static_cast<int>(tile % columns) * kTileSize;
    const int y0 = static_cast<int>(tile / columns) * kTileSize;
    fn(x0, y0, std::min(width, x0 + kTileSize), std::min(height, y0 + kTileSize));
  });
}

// Rays of one pixel that hit the same surface.
struct SurfacePart {
  Hit hit;  // the first one
  Eigen::Vector3d point_sum = Eigen::Vector3d::Zero();
  double footprint_sum = 0;
  int num_rays = 0;
};

// Averages over the pixel's rays. Texture is evaluated once a surface, at the rays' mean point: it
// fades detail below a pixel by itself, and it is what takes the time.
Eigen::Vector3f PixelColor(const RayCaster& caster, int x, int y, int supersampling,
                           std::span<const int> solids) {
  const World& world = caster.world();
  std::vector<SurfacePart> parts;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int sy = 0; sy < supersampling; ++sy) {
    for (int sx = 0; sx < supersampling; ++sx) {
      const Ray ray = caster.At(x + (sx + 0.5) / supersampling, y + (sy + 0.5) / supersampling);
      const std::optional<Hit> hit = world.Cast(ray, solids);
      if (!hit) {
        sum += world.SkyColor(ray.direction);
        continue;
      }
      auto part = std::find_if(parts.begin(), parts.end(), [&](const SurfacePart& p) {
        return p.hit.solid == hit->solid && p.hit.normal.dot(hit->normal) > 0.95;
      });
      if (part == parts.end()) part = parts.insert(parts.end(), SurfacePart{*hit});
      part->point_sum += ray.origin + hit->t * ray.direction;
      part->footprint_sum += caster.Footprint(ray, *hit);
      ++part->num_rays;
    }
  }
  for (const SurfacePart& part : parts) {
    sum += part.num_rays * world.Shade(part.hit, part.point_sum / part.num_rays,
                                       part.footprint_sum / part.num_rays);
  }
  return sum / static_cast<float>(supersampling * supersampling);
}

// Depth is along the axis, so that every pixel has to look ahead.
void CheckLooksAhead(const Camera& camera) {
  for (const double x : {0, camera.width}) {
    for (const double y : {0, camera.height}) {
      if (camera.CamFromImg({x, y})) continue;
      throw ConfigError("camera_model",
                        "photographs are rendered for less than 180 degrees; a "
                        "longer focal_length, or another model, has less");
    }
  }
}

// Slowly varying relative error of a depth map at (x, y) in [0, 1]^2; deviation about 1.
double SmoothDepthError(uint64_t seed, double x, double y) {
  double error = 0;
  double amplitude = 1.0;
  double frequency = 2.0;
  for (int octave = 0; octave < 3; ++octave) {
    error += amplitude * ValueNoise(seed + octave, {frequency * x, frequency * y, 0.5});
    amplitude *= 0.6;
    frequency *= 2.0;
  }
  return 3.0 * error;
}

}  // namespace

void PhotoOptions::VisitFields(OptionVisitor& v) {
  v.Int("supersampling", supersampling, {1, 8}, "rays a pixel in x and in y");
  v.Double("sensor_noise", sensor_noise, {0.0, 50.0}, "standard deviation, gray levels of 255");
  v.Double("depth_noise", depth_noise, {0.0, 0.5}, "relative error of depth maps");
  v.Int("depth_downscale", depth_downscale, {1, 64}, "image pixels a depth map's pixel covers");
}

PhotoScene MakePhotoScene(const PhotoOptions& options, uint64_t seed) {
  ValidateOptions(static_cast<const RigOptions&>(options), "");
  ValidateOptions(options, "photos");
  PhotoScene scene;
  scene.options = options;
  scene.seed = seed;
  scene.images = MakeImages(options);
  scene.truth.cameras = MakeCameras(options);
  for (const auto& [id, camera] : scene.truth.cameras) CheckLooksAhead(camera);
  const CameraLayout layout = options.layout;
  Rng rng(seed, "photo_poses");
  scene.cam_from_world = MakeCameraPoses(layout, options.num_images, options.distance, rng);
  Rng other_rng(seed, "photo_distractor_poses");
  for (const Rigid3d& pose :
       MakeCameraPoses(layout, options.num_distractor_images, options.distance, other_rng)) {
    scene.cam_from_world.push_back(pose);
  }
  for (size_t i = 0; i < scene.images.size(); ++i) {
    scene.depth_units.push_back(std::exp(0.5 * Rng(seed, "photo_depth_unit", i).Gaussian()));
  }
  for (int i = 0; i < options.num_images; ++i) {
    scene.truth.images.emplace(scene.images[i].image_id,
                               RegisteredImage{scene.images[i], scene.cam_from_world[i], {}, {}});
  }
  return scene;
}

Bitmap RenderPhoto(const PhotoScene& scene, int index, int num_threads) {
  const Camera& camera = CameraOf(scene, index);
  const RayCaster caster(scene, index);
  Bitmap bitmap{camera.width, camera.height, 3, {}};
  bitmap.data.resize(static_cast<size_t>(3) * camera.width * camera.height);
  ForEachTile(num_threads, camera.width, camera.height, [&](int x0, int y0, int x1, int y1) {
    const std::vector<int> solids = caster.Candidates(x0, y0, x1, y1);
    for (int y = y0; y < y1; ++y) {
      Rng noise(scene.seed, "photo_noise", (static_cast<uint64_t>(index) << 32) + (y << 16) + x0);
      for (int x = x0; x < x1; ++x) {
        const Eigen::Vector3f color = PixelColor(caster, x, y, scene.options.supersampling, solids);
        for (int k = 0; k < 3; ++k) {
          const double value = 255.0 * color[k] + scene.options.sensor_noise * noise.Gaussian();
          bitmap.Pixel(x, y)[k] = static_cast<uint8_t>(std::clamp(value + 0.5, 0.0, 255.0));
        }
      }
    }
  });
  return bitmap;
}

DepthMap RenderDepthMap(const PhotoScene& scene, int index, int num_threads) {
  const Camera& camera = CameraOf(scene, index);
  const RayCaster caster(scene, index);
  const int step = scene.options.depth_downscale;
  DepthMap map;
  map.width = (camera.width + step - 1) / step;
  map.height = (camera.height + step - 1) / step;
  map.values.resize(static_cast<size_t>(map.width) * map.height);
  map.is_valid.resize(map.values.size());
  const double pixel_width = static_cast<double>(camera.width) / map.width;
  const double pixel_height = static_cast<double>(camera.height) / map.height;
  const double unit = scene.depth_units[index];
  const uint64_t error_seed = Rng(scene.seed, "photo_depth_error", index).NextU64();
  ForEachTile(num_threads, map.width, map.height, [&](int x0, int y0, int x1, int y1) {
    const std::vector<int> solids =
        caster.Candidates(x0 * pixel_width, y0 * pixel_height, x1 * pixel_width, y1 * pixel_height);
    for (int y = y0; y < y1; ++y) {
      Rng noise(error_seed, "row", (static_cast<uint64_t>(y) << 32) + x0);
      for (int x = x0; x < x1; ++x) {
        const Ray ray = caster.At((x + 0.5) * pixel_width, (y + 0.5) * pixel_height);
        const double fine = noise.Gaussian();
        const std::optional<Hit> hit = caster.world().Cast(ray, solids);
        if (!hit) continue;
        const double smooth =
            SmoothDepthError(error_seed, (x + 0.5) / map.width, (y + 0.5) / map.height);
        const double error = scene.options.depth_noise * (0.97 * smooth + 0.25 * fine);
        const size_t pixel = static_cast<size_t>(y) * map.width + x;
        map.values[pixel] = static_cast<float>(unit * hit->t * std::max(0.1, 1.0 + error));
        map.is_valid[pixel] = 1;
      }
    }
  });
  return map;
}

void WritePhotoScene(const PhotoScene& scene, const std::string& folder, int num_threads,
                     ProgressMonitor& monitor) {
  CreateFolders(folder + "/images");
  CreateFolders(folder + "/depth");
  WriteColmapModel(scene.truth, folder + "/truth", ColmapModelFormat::kText);
  monitor.BeginStage("render photographs", static_cast<int64_t>(scene.images.size()));
  for (size_t i = 0; i < scene.images.size() && !monitor.StopRequested(); ++i) {
    const Image& image = scene.images[i];
    const std::string path = folder + "/images/" + image.name;
    WriteBitmap(path, RenderPhoto(scene, static_cast<int>(i), num_threads));
    const int camera_index = static_cast<int>(image.camera_id) - 1;
    WriteExif(path, {FocalLength35mm(scene.options, camera_index), "cairn",
                     "synthetic camera " + std::to_string(image.camera_id)});
    WriteDepthMap(folder + "/depth/" + image.name + ".npy",
                  RenderDepthMap(scene, static_cast<int>(i), num_threads));
    monitor.Advance(1);
  }
  monitor.EndStage();
}

}  // namespace cairn
