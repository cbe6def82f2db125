#pragma once

#include <cstdint>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/solvers/affine_frame.h"
#include "cairn/solvers/one_affine_depth.h"
#include "cairn/solvers/point_correspondence.h"
#include "cairn/synthetic/surface.h"

namespace cairn::experiments {

// Correspondences of an instance: samples for the solvers (the five-point solver takes all five,
// 2AC the first two, 1AC+D the first), then others, which choose among several solutions as a
// robust estimator would.
inline constexpr int kNumSampled = 5;
inline constexpr int kNumOthers = 10;

// One instance of the paper's synthetic setup.
struct Instance {
  Camera camera;  // of both views: f = 600 px, principal point (300, 300)
  Rigid3d cam2_from_cam1;
  std::vector<AffineObservation> view1, view2;  // kNumSampled + kNumOthers each
  // Units of the two depth maps, per world unit: depth is relative.
  double depth1_unit = 1.0, depth2_unit = 1.0;
};

// Instance `index` without noise: two cameras at distance 1 to 2 around the origin that look at a
// point of [-0.5, 0.5]^3, points from N(0, I) with random normals, the frame's axes spanning the
// plane (unit length, random angle). Drawn again as a whole while one of the sampled points lies
// behind a camera or shows its two sides to the two cameras; the other points are drawn again one
// by one. The depth units are drawn between 1/2 and 2.
Instance MakeInstance(uint64_t seed, int64_t index);
std::vector<Instance> MakeInstances(uint64_t seed, int64_t count, int num_threads);

// Standard deviations of Gaussian noise.
struct NoiseLevels {
  double image_px = 0;  // each coordinate
  double affine = 0;    // each entry of the shape, over the frame's size sqrt(|det|)
  double depth = 0;     // relative for the depth; as a slope of the surface for its gradient
};

// The instance with noise on all observations. The random numbers depend on seed and index alone,
// so that levels differ in size only and curves over levels are smooth.
Instance WithNoise(const Instance& exact, const NoiseLevels& levels, uint64_t seed, int64_t index);

// What the solvers take, in normalized coordinates.
PointCorrespondence PointsOf(const Instance& instance, int i);
AffineCorrespondence AffineOf(const Instance& instance, int i);
LiftedCorrespondence LiftedOf(const Instance& instance, int i);

}  // namespace cairn::experiments
