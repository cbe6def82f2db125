#include "relative_pose_experiments/paper_setup.h"

#include <cmath>
#include <numbers>
#include <optional>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/base/rng.h"
#include "cairn/synthetic/poses.h"

namespace cairn::experiments {
namespace {

constexpr double kFocalPx = 600.0;
constexpr int kImageSize = 600;

Rigid3d RandomCamera(Rng& rng) {
  const Eigen::Vector3d center = RandomOfLength(1.0, 2.0, rng);
  const double x = rng.Uniform(-0.5, 0.5), y = rng.Uniform(-0.5, 0.5), z = rng.Uniform(-0.5, 0.5);
  return LookAt(center, {x, y, z}, rng.Uniform(0.0, 2.0 * std::numbers::pi));
}

struct Views {
  AffineObservation view1, view2;
};

// A random surface element as both cameras see it: absent behind a camera, or from opposite sides.
std::optional<Views> DrawElement(const Camera& camera, const Rigid3d& cam1_from_world,
                                 const Rigid3d& cam2_from_world, Rng& rng) {
  const double x = rng.Gaussian(), y = rng.Gaussian(), z = rng.Gaussian();
  const Eigen::Vector3d normal = RandomDirection(rng);
  const SurfaceElement element =
      MakeSurfaceElement({x, y, z}, normal, 1.0, rng.Uniform(0.0, 2.0 * std::numbers::pi));
  const auto view1 = Observe(camera, cam1_from_world, element);
  const auto view2 = Observe(camera, cam2_from_world, element);
  if (!view1 || !view2) return std::nullopt;
  if (view1->shape.determinant() * view2->shape.determinant() <= 0) return std::nullopt;
  return Views{*view1, *view2};
}

void SetDepthUnit(double unit, std::vector<AffineObservation>* view) {
  for (AffineObservation& observation : *view) {
    observation.depth *= unit;
    observation.depth_gradient *= unit;
  }
}

// One attempt: absent if one of the sampled elements cannot be used.
std::optional<Instance> DrawInstance(Rng& rng) {
  Instance instance;
  instance.camera =
      Camera::FromFocal(1, CameraModel::kSimplePinhole, kFocalPx, kImageSize, kImageSize);
  const Rigid3d cam1_from_world = RandomCamera(rng);
  const Rigid3d cam2_from_world = RandomCamera(rng);
  instance.cam2_from_cam1 = cam2_from_world * Inverse(cam1_from_world);
  while (instance.view1.size() < kNumSampled + kNumOthers) {
    const auto views = DrawElement(instance.camera, cam1_from_world, cam2_from_world, rng);
    if (!views && instance.view1.size() < kNumSampled) return std::nullopt;
    if (!views) continue;
    instance.view1.push_back(views->view1);
    instance.view2.push_back(views->view2);
  }
  instance.depth1_unit = std::exp2(rng.Uniform(-1.0, 1.0));
  instance.depth2_unit = std::exp2(rng.Uniform(-1.0, 1.0));
  SetDepthUnit(instance.depth1_unit, &instance.view1);
  SetDepthUnit(instance.depth2_unit, &instance.view2);
  return instance;
}

NormalizedFrame Normalized(const Camera& camera, const AffineObservation& observation) {
  Eigen::Matrix2d J;
  const auto uv = camera.CamFromImg(observation.pixel, &J);
  CAIRN_CHECK(uv.has_value());
  return {*uv, J * observation.shape};
}

LiftedFrame Lifted(const Camera& camera, const AffineObservation& o) {
  const auto frame = LiftFrame(camera, o.pixel, o.shape, o.depth, o.depth_gradient);
  CAIRN_CHECK(frame.has_value());
  return *frame;
}

}  // namespace

Instance MakeInstance(uint64_t seed, int64_t index) {
  Rng rng(seed, "paper_setup", static_cast<uint64_t>(index));
  for (;;) {
    if (auto instance = DrawInstance(rng)) return *instance;
  }
}

std::vector<Instance> MakeInstances(uint64_t seed, int64_t count, int num_threads) {
  std::vector<Instance> instances(count);
  ParallelFor(
      num_threads, count, [&](int64_t i) { instances[i] = MakeInstance(seed, i); }, 64);
  return instances;
}

Instance WithNoise(const Instance& exact, const NoiseLevels& levels, uint64_t seed, int64_t index) {
  const ObservationNoise noise = {.image_px = levels.image_px,
                                  .affine = levels.affine,
                                  .depth = levels.depth,
                                  .depth_gradient = levels.depth};
  Rng rng(seed, "paper_setup_noise", static_cast<uint64_t>(index));
  Instance noisy = exact;
  for (auto* view : {&noisy.view1, &noisy.view2}) {
    for (AffineObservation& observation : *view) {
      observation = AddNoise(observation, noise, kFocalPx, rng);
    }
  }
  return noisy;
}

PointCorrespondence PointsOf(const Instance& instance, int i) {
  return {*instance.camera.CamFromImg(instance.view1[i].pixel),
          *instance.camera.CamFromImg(instance.view2[i].pixel)};
}

AffineCorrespondence AffineOf(const Instance& instance, int i) {
  return {Normalized(instance.camera, instance.view1[i]),
          Normalized(instance.camera, instance.view2[i])};
}

LiftedCorrespondence LiftedOf(const Instance& instance, int i) {
  return {Lifted(instance.camera, instance.view1[i]), Lifted(instance.camera, instance.view2[i])};
}

}  // namespace cairn::experiments
