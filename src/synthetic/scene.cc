#include "cairn/synthetic/scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/synthetic/poses.h"
#include "math/random_vectors.h"
#include "synthetic/city.h"
#include "synthetic/relief.h"

namespace cairn {
namespace {

constexpr double kReliefAmplitude = 0.15;  // world units
constexpr double kMinFacingCosine = 0.25;  // an element is detected up to 75 degrees off its normal

bool IsWallLayout(CameraLayout layout) {
  return layout == CameraLayout::kArc || layout == CameraLayout::kStreet;
}

// Half of the wall's length: what the cameras of a street see, or 1.
double HalfLength(const RigOptions& options) {
  return options.layout == CameraLayout::kStreet
             ? 0.5 * options.distance * (1 + kStreetStep * options.num_images)
             : 1.0;
}

std::vector<SurfaceElement> MakeElements(const SceneOptions& options, Rng& rng) {
  const Relief relief(rng);
  std::vector<SurfaceElement> elements;
  elements.reserve(options.num_points);
  for (int i = 0; i < options.num_points; ++i) {
    const double size = 0.005 * std::exp(rng.Uniform(0.0, 1.8));
    elements.push_back(IsWallLayout(options.layout)
                           ? SampleWall(relief, kReliefAmplitude, HalfLength(options), size, rng)
                           : SampleTower(relief, kReliefAmplitude, size, rng));
  }
  return elements;
}

// An image that is to be made.
struct Shot {
  int index;
  const Camera& camera;
  const Rigid3d* cam_from_world;  // null: of another place
};

// A keypoint before it got its place among the others.
struct Detection {
  AffineObservation observation;
  int element = -1;  // -1: clutter
};

// Absent where the camera does not see the element.
std::optional<AffineObservation> See(const Camera& camera, const Rigid3d& cam_from_world,
                                     const SurfaceElement& element) {
  const Eigen::Vector3d ray = cam_from_world.Center() - element.point;
  if (ray.dot(element.Normal()) < kMinFacingCosine * ray.norm()) return std::nullopt;
  const auto view = Observe(camera, cam_from_world, element);
  return view && IsInImage(camera, view->pixel) ? view : std::nullopt;
}

// What an image shows that no other does: frames and depth of a plausible size.
Detection MakeClutter(const Camera& camera, double distance, Rng& rng) {
  Detection detection;
  AffineObservation& view = detection.observation;
  view.pixel = {rng.Uniform(0.0, camera.width), rng.Uniform(0.0, camera.height)};
  const double size = 2.0 * std::exp(rng.Uniform(0.0, 1.8));
  const double angle = rng.Uniform(0.0, 2.0 * std::numbers::pi);
  view.shape = size * Eigen::Rotation2Dd(angle).toRotationMatrix();
  view.shape.row(1) *= rng.Uniform(0.5, 1.0);
  view.depth = distance * rng.Uniform(0.7, 1.3);
  view.depth_gradient =
      view.depth / camera.MeanFocal() * (0.5 * GaussianVector<2>(rng)).transpose();
  return detection;
}

// What there is to see, and how readily it is noticed: a logarithm, the same for all images.
struct Surface {
  std::vector<SurfaceElement> elements;
  std::vector<double> salience;
  std::optional<City> city;  // then elements are by place

  size_t PlaceSize() const { return elements.size() / (city ? city->NumPlaces() : 1); }
};

double DrawSalience(const SceneOptions& options, Rng& rng) {
  return -options.salience * std::log(1.0 - rng.Uniform());
}

Surface MakeCitySurface(const SceneOptions& options, uint64_t seed) {
  Surface surface{{}, {}, City(options.num_images)};
  const City& city = *surface.city;
  Rng relief_rng(seed, "scene_elements");
  const Relief relief(relief_rng);
  for (int place = 0; place < city.NumPlaces(); ++place) {
    const Rigid3d world_from_place = city.WorldFromPlace(place);
    Rng own(seed, "scene_place", place);
    Rng shared(seed, "scene_twins", std::min(place, city.TwinOf(place)));
    for (int k = 0; k < options.num_points / city.NumPlaces(); ++k) {
      Rng& rng = k % City::kAlikeEvery == 0 ? shared : own;
      const double size = 0.005 * std::exp(rng.Uniform(0.0, 1.8));
      SurfaceElement element = SampleTower(relief, kReliefAmplitude, size, rng);
      element.point = world_from_place * element.point;
      element.tangents = world_from_place.RotationMatrix() * element.tangents;
      surface.elements.push_back(element);
      surface.salience.push_back(DrawSalience(options, rng));
    }
  }
  return surface;
}

Surface MakeSurface(const SceneOptions& options, uint64_t seed) {
  if (options.layout == CameraLayout::kCity) return MakeCitySurface(options, seed);
  Rng element_rng(seed, "scene_elements");
  Surface surface{MakeElements(options, element_rng), {}, {}};
  Rng salience_rng(seed, "scene_salience");
  for (int i = 0; i < options.num_points; ++i) {
    surface.salience.push_back(DrawSalience(options, salience_rng));
  }
  return surface;
}

// A random choice without replacement where an element's chances are exp(salience) (Gumbel's
// trick); the rest goes.
void KeepNoticed(const Surface& surface, size_t max_keypoints, Rng& rng,
                 std::vector<Detection>* detections) {
  if (detections->size() <= max_keypoints) return;
  std::vector<std::pair<double, size_t>> keys;
  for (size_t k = 0; k < detections->size(); ++k) {
    const Detection& detection = (*detections)[k];
    const double gumbel = -std::log(-std::log(1.0 - rng.Uniform()));
    // Far places show less.
    const double nearness = surface.city ? -2 * std::log(detection.observation.depth) : 0.0;
    keys.emplace_back(-surface.salience[detection.element] - nearness - gumbel, k);
  }
  std::nth_element(keys.begin(), keys.begin() + static_cast<int64_t>(max_keypoints), keys.end());
  keys.resize(max_keypoints);
  std::vector<Detection> kept;
  for (const auto& [key, k] : keys) kept.push_back((*detections)[k]);
  *detections = std::move(kept);
}

// Of the twin places, the middle belongs to both and the rest to one of them.
bool IsInPlace(const SurfaceElement& element, int index, int place) {
  constexpr double kHalfWidth = 0.5;
  return std::abs(element.point.x()) < kHalfWidth || index % 2 == place;
}

// First and last element of what may be in view.
using Range = std::pair<size_t, size_t>;
std::vector<Range> RangesInView(const Surface& surface, int image, const Camera& camera,
                                const Rigid3d& cam_from_world) {
  if (!surface.city) return {{0, surface.elements.size()}};
  const double half_view = std::atan(0.5 * camera.DiagonalPx() / camera.MeanFocal());
  std::vector<Range> ranges;
  for (int place = 0; place < surface.city->NumPlaces(); ++place) {
    if (!surface.city->AreNeighbors(place, surface.city->PlaceOf(image))) continue;
    const Eigen::Vector3d center = cam_from_world * surface.city->WorldFromPlace(place).translation;
    const double radius = std::asin(std::min(1.0, 1.3 / center.norm()));
    if (std::atan2(center.head<2>().norm(), center.z()) > half_view + radius) continue;
    ranges.emplace_back(place * surface.PlaceSize(), (place + 1) * surface.PlaceSize());
  }
  return ranges;
}

std::vector<Detection> Detect(const SceneOptions& options, const Shot& shot, const Surface& surface,
                              Rng& rng) {
  const auto& [image, camera, cam_from_world] = shot;
  std::vector<Detection> detections;
  if (cam_from_world) {
    for (const auto& [begin, end] : RangesInView(surface, image, camera, *cam_from_world)) {
      for (size_t i = begin; i < end; ++i) {
        const int index = static_cast<int>(i);
        if (options.twin_places && !IsInPlace(surface.elements[i], index, image % 2)) continue;
        const auto view = See(camera, *cam_from_world, surface.elements[i]);
        if (view) detections.push_back({*view, index});
      }
    }
    if (options.salience > 0) KeepNoticed(surface, options.max_keypoints, rng, &detections);
    rng.Shuffle(detections);
    if (detections.size() > static_cast<size_t>(options.max_keypoints)) {
      detections.resize(options.max_keypoints);
    }
  }
  const int num_clutter = cam_from_world
                              ? options.num_clutter_keypoints
                              : options.num_clutter_keypoints + options.max_keypoints / 2;
  for (int i = 0; i < num_clutter; ++i) {
    detections.push_back(MakeClutter(camera, options.distance, rng));
  }
  rng.Shuffle(detections);
  return detections;
}

// One image's part of the scene; made independently of all other images.
struct ImageData {
  std::vector<Keypoint> keypoints;
  std::vector<DepthSample> depth_samples;
  std::vector<int> elements;
};

ImageData MakeImageData(const SceneOptions& options, const Shot& shot, const Surface& surface,
                        Rng rng) {
  const ObservationNoise noise{options.image_noise_px, options.affine_noise, options.depth_noise,
                               options.depth_gradient_noise};
  ImageData data;
  const double depth_scale = std::exp(0.7 * rng.Gaussian());
  for (const Detection& detection : Detect(options, shot, surface, rng)) {
    const AffineObservation noisy =
        AddNoise(detection.observation, noise, shot.camera.MeanFocal(), rng);
    data.keypoints.push_back(noisy.ToKeypoint());
    const bool has_depth = rng.Uniform() >= options.missing_depth_ratio;
    data.depth_samples.push_back(has_depth ? noisy.ToDepthSample(depth_scale) : DepthSample{});
    data.elements.push_back(detection.element);
  }
  return data;
}

// Points with at least two observations, and each image's references to them. Point ids are element
// indices + 1.
void LinkPoints(const std::vector<SurfaceElement>& elements, const std::vector<ImageData>& data,
                Reconstruction* truth) {
  std::vector<Track> tracks(elements.size());
  for (auto& [id, image] : truth->images) {
    const std::vector<int>& image_elements = data[id - 1].elements;
    for (size_t k = 0; k < image_elements.size(); ++k) {
      if (image_elements[k] >= 0) {
        tracks[image_elements[k]].push_back({id, static_cast<point2D_t>(k)});
      }
    }
  }
  for (size_t i = 0; i < elements.size(); ++i) {
    if (tracks[i].size() < 2) continue;
    Point3D point;
    point.xyz = elements[i].point;
    const double shade = 0.5 * (elements[i].Normal().z() + 1.0);
    point.color = {static_cast<uint8_t>(80 + 120 * shade), static_cast<uint8_t>(90 + 90 * shade),
                   120};
    point.track = std::move(tracks[i]);
    const point3D_t id = i + 1;
    for (const TrackElement& e : point.track) {
      truth->images.at(e.image_id).point3D_ids[e.point2D] = id;
    }
    truth->points3D.emplace_hint(truth->points3D.end(), id, std::move(point));
  }
  truth->UpdatePointErrors();
}

}  // namespace

void SceneOptions::VisitFields(OptionVisitor& v) {
  v.Int("num_points", num_points, {0, 1e8}, "surface elements of an abstract scene");
  v.Int("max_keypoints", max_keypoints, {0, 1e6}, "scene points that an image shows, at most");
  v.Double("salience", salience, {0.0, 10.0},
           "0: images show a random choice of what is visible; larger: the same points more often, "
           "as detectors do");
  v.Double("image_noise_px", image_noise_px, {0.0, 100.0}, "keypoint noise, standard deviation");
  v.Double("affine_noise", affine_noise, {0.0, 1.0}, "noise of affine frames, relative");
  v.Double("depth_noise", depth_noise, {0.0, 1.0}, "noise of depth, relative");
  v.Double("depth_gradient_noise", depth_gradient_noise, {0.0, 10.0},
           "noise of the depth gradient, as a slope");
  v.Double("missing_depth_ratio", missing_depth_ratio, {0.0, 1.0},
           "share of keypoints without depth");
  v.Double("outlier_ratio", outlier_ratio, {0.0, 0.99}, "share of wrong matches in a pair");
  v.Int("num_chance_matches", num_chance_matches, {0, 1e6},
        "wrong matches of a pair that does not overlap");
  v.Int("num_clutter_keypoints", num_clutter_keypoints, {0, 1e6},
        "keypoints an image that show no scene point");
  v.Bool("twin_places", twin_places,
         "every second image is of another place whose middle looks the same");
  v.Int("num_pairs", num_pairs, {0, 2e8},
        "pairs in a database: those with the most points in common; 0: all");
  v.Double("pair_outlier_ratio", pair_outlier_ratio, {0.0, 1.0},
           "share of verified pairs whose pose and matches are random");
  EdgeNoise::VisitFields(v);
  v.Bool("descriptors", descriptors, "write descriptors to a database");
  v.Bool("pair_metrics", pair_metrics,
         "verified pairs as build_view_graph leaves them; 0: as COLMAP does");
}

SyntheticScene MakeScene(const SceneOptions& options, uint64_t seed, int num_threads) {
  ValidateOptions(static_cast<const RigOptions&>(options), "");
  ValidateOptions(options, "scene");
  if (options.layout == CameraLayout::kCity && options.pair_outlier_ratio > 0 &&
      (options.num_pairs == 0 || !City(options.num_images).HasTwins())) {
    throw ConfigError("scene.pair_outlier_ratio",
                      "of a city takes scene.num_pairs, and 600 images: fewer have no places that "
                      "look alike");
  }
  SyntheticScene scene;
  scene.options = options;
  scene.seed = seed;
  scene.num_threads = num_threads;
  scene.cameras = MakeCameras(options);
  scene.images = MakeImages(options);
  const Surface surface = MakeSurface(options, seed);
  Rng pose_rng(seed, "scene_poses");
  const std::vector<Rigid3d> poses =
      MakeCameraPoses(options.layout, options.num_images, options.distance, pose_rng);

  const int num_images = static_cast<int>(scene.images.size());
  std::vector<ImageData> data(num_images);
  ParallelFor(num_threads, num_images, [&](int64_t i) {
    const Rigid3d* pose = i < options.num_images ? &poses[i] : nullptr;
    const Shot shot{static_cast<int>(i), scene.cameras.at(scene.images[i].camera_id), pose};
    data[i] = MakeImageData(options, shot, surface, Rng(seed, "scene_image", i + 1));
  });

  scene.truth.cameras = scene.cameras;
  for (int i = 0; i < num_images; ++i) {
    const image_t id = i + 1;
    if (i < options.num_images) {
      RegisteredImage image{scene.images[i], poses[i], {}, {}};
      for (const Keypoint& keypoint : data[i].keypoints) {
        image.points2D.push_back(keypoint.Position());
      }
      image.point3D_ids.assign(image.points2D.size(), kInvalidPoint3DId);
      scene.truth.images.emplace(id, std::move(image));
    }
    scene.keypoints[id] = std::move(data[i].keypoints);
    scene.depth_samples[id] = std::move(data[i].depth_samples);
  }
  LinkPoints(surface.elements, data, &scene.truth);
  return scene;
}

}  // namespace cairn
