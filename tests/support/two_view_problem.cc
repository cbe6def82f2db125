#include "support/two_view_problem.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "cairn/base/check.h"
#include "cairn/math/angles.h"
#include "cairn/synthetic/poses.h"
#include "math/random_vectors.h"
#include "synthetic/relief.h"

namespace cairn {
namespace {

constexpr double kDistance = 3.0;  // of the cameras from the wall, world units
constexpr int kMaxDraws = 100000;  // far more than any layout needs

// What both images see of an element; absent when one does not see its front.
struct ObservationPair {
  SurfaceElement element;
  AffineObservation view1, view2;
};

Camera MakePinhole(camera_t id, double focal_px, int width, int height) {
  Camera camera = Camera::FromFocal(id, CameraModel::kPinhole, focal_px, width, height);
  camera.has_prior_focal_length = true;
  return camera;
}

void PlaceCameras(const TwoViewProblemOptions& options, Rng& rng, TwoViewProblem* problem) {
  if (options.layout == TwoViewLayout::kPaper) {
    problem->camera1 = MakePinhole(1, 600.0, 600, 600);
    problem->camera2 = MakePinhole(2, 600.0, 600, 600);
    for (Rigid3d* pose : {&problem->cam1_from_world, &problem->cam2_from_world}) {
      const Eigen::Vector3d center = RandomOfLength(1.0, 2.0, rng);
      const Eigen::Vector3d target = UniformVector({{-0.5, 0.5}, {-0.5, 0.5}, {-0.5, 0.5}}, rng);
      *pose = LookAt(center, target, rng.Uniform(0.0, 2.0 * std::numbers::pi));
    }
    return;
  }
  problem->camera1 = MakePinhole(1, 1100.0, 1024, 768);
  problem->camera2 = MakePinhole(2, 1300.0, 1200, 800);
  const double tilt = rng.Uniform(0.0, std::numbers::pi);  // direction of the baseline
  const double half = 0.5 * DegToRad(options.baseline_angle_deg);
  const auto center = [&](double angle) {
    return Eigen::Vector3d(kDistance * std::sin(angle) * std::cos(tilt),
                           -kDistance * std::cos(angle),
                           kDistance * std::sin(angle) * std::sin(tilt));
  };
  const auto look_from = [&](const Eigen::Vector3d& center) {
    const double roll = DegToRad(5.0) * rng.Gaussian();
    const Eigen::Vector3d target = 0.1 * GaussianVector<3>(rng);
    return LookAt(center, target, roll);
  };
  problem->cam1_from_world = look_from(center(-half));
  problem->cam2_from_world = look_from(center(half));
}

SurfaceElement SampleElement(TwoViewLayout layout, const Relief& relief, Rng& rng) {
  const double size = 0.005 * std::exp(rng.Uniform(0.0, 1.8));  // 2 to 12 px
  if (layout == TwoViewLayout::kPaper) {
    const Eigen::Vector3d point = GaussianVector<3>(rng);
    const double angle = rng.Uniform(0.0, 2.0 * std::numbers::pi);
    return MakeSurfaceElement(point, RandomDirection(rng), size, angle);
  }
  return SampleWall(relief, layout == TwoViewLayout::kPlane ? 0.0 : 0.2, 1.0, size, rng);
}

// Draws until both cameras see an element: in kPaper from the same side, else both its front and
// within their images.
ObservationPair SamplePair(const TwoViewProblem& problem, TwoViewLayout layout,
                           const Relief& relief, Rng& rng) {
  for (int draw = 0; draw < kMaxDraws; ++draw) {
    const SurfaceElement element = SampleElement(layout, relief, rng);
    const auto view1 = Observe(problem.camera1, problem.cam1_from_world, element);
    const auto view2 = Observe(problem.camera2, problem.cam2_from_world, element);
    if (!view1 || !view2) continue;
    const double det1 = view1->shape.determinant();
    const double det2 = view2->shape.determinant();
    if (layout == TwoViewLayout::kPaper) {
      if (det1 * det2 > 0) return {element, *view1, *view2};
    } else if (det1 > 0 && det2 > 0 && IsInImage(problem.camera1, view1->pixel) &&
               IsInImage(problem.camera2, view2->pixel)) {
      return {element, *view1, *view2};
    }
  }
  CAIRN_CHECK(!"the two cameras see nothing in common");
  return {};
}

DepthSample MakeDepthSample(const AffineObservation& observation, double scale,
                            double missing_ratio, Rng& rng) {
  if (rng.Uniform() < missing_ratio) return {};
  return observation.ToDepthSample(scale);
}

std::vector<point2D_t> RandomPermutation(int n, Rng& rng) {
  std::vector<point2D_t> permutation(n);
  std::iota(permutation.begin(), permutation.end(), point2D_t{0});
  rng.Shuffle(permutation);
  return permutation;
}

}  // namespace

TwoViewProblem MakeTwoViewProblem(const TwoViewProblemOptions& options, uint64_t seed) {
  CAIRN_CHECK_GE(options.num_matches, 0);
  CAIRN_CHECK(options.outlier_ratio >= 0 && options.outlier_ratio <= 1);
  Rng rng(seed, "two_view_problem");
  TwoViewProblem problem;
  PlaceCameras(options, rng, &problem);
  problem.cam2_from_cam1 = problem.cam2_from_world * Inverse(problem.cam1_from_world);
  problem.depth_ratio = options.depth2_scale / options.depth1_scale;

  const Relief relief(rng);
  const int n = options.num_matches;
  const int num_outliers = static_cast<int>(std::lround(options.outlier_ratio * n));
  std::vector<char> is_inlier(n, 1);
  std::fill_n(is_inlier.begin(), num_outliers, 0);
  rng.Shuffle(is_inlier);
  problem.is_inlier.assign(is_inlier.begin(), is_inlier.end());

  const std::vector<point2D_t> order1 = RandomPermutation(n, rng);
  const std::vector<point2D_t> order2 = RandomPermutation(n, rng);
  problem.observations1.resize(n);
  problem.observations2.resize(n);
  for (int i = 0; i < n; ++i) {
    const ObservationPair pair = SamplePair(problem, options.layout, relief, rng);
    problem.exact1.push_back(pair.view1);
    if (problem.is_inlier[i]) {
      problem.elements.push_back(pair.element);
      problem.exact2.push_back(pair.view2);
    } else {
      problem.exact2.push_back(SamplePair(problem, options.layout, relief, rng).view2);
    }
    problem.observations1[order1[i]] =
        AddNoise(problem.exact1[i], options.noise, problem.camera1.MeanFocal(), rng);
    problem.observations2[order2[i]] =
        AddNoise(problem.exact2[i], options.noise, problem.camera2.MeanFocal(), rng);
    problem.matches.push_back({order1[i], order2[i]});
  }
  for (int i = 0; i < n; ++i) {
    problem.keypoints1.push_back(problem.observations1[i].ToKeypoint());
    problem.keypoints2.push_back(problem.observations2[i].ToKeypoint());
    problem.depth1.push_back(MakeDepthSample(problem.observations1[i], options.depth1_scale,
                                             options.missing_depth_ratio, rng));
    problem.depth2.push_back(MakeDepthSample(problem.observations2[i], options.depth2_scale,
                                             options.missing_depth_ratio, rng));
  }
  return problem;
}

}  // namespace cairn
