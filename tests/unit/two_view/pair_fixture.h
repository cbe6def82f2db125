#pragma once

#include <Eigen/LU>
#include <vector>

#include "cairn/geometry/epipolar.h"
#include "cairn/two_view/pair_verifier.h"
#include "math/random_vectors.h"
#include "support/random_two_view.h"
#include "support/two_view_problem.h"

namespace cairn {

inline Keypoint RoundKeypoint(const Eigen::Vector2d& pixel) {
  return Keypoint::FromScaleOrientation(static_cast<float>(pixel.x()),
                                        static_cast<float>(pixel.y()), 3.0f, 0.0f);
}

// Everything a PairInput points to.
struct Pair {
  Camera camera1, camera2;
  Rigid3d cam2_from_cam1;
  std::vector<Keypoint> keypoints1, keypoints2;
  std::vector<DepthSample> depth1, depth2;
  FeatureMatches matches;
  std::vector<bool> is_inlier;

  PairInput Input(bool with_depth = true) const {
    PairInput input;
    input.pair_id = 42;
    input.seed = 7;
    input.camera1 = &camera1;
    input.camera2 = &camera2;
    input.keypoints1 = keypoints1;
    input.keypoints2 = keypoints2;
    if (with_depth) {
      input.depth1 = depth1;
      input.depth2 = depth2;
    }
    input.matches = matches;
    return input;
  }

  Pair Swapped() const {
    Pair s = *this;
    std::swap(s.camera1, s.camera2);
    std::swap(s.keypoints1, s.keypoints2);
    std::swap(s.depth1, s.depth2);
    s.cam2_from_cam1 = Inverse(cam2_from_cam1);
    for (FeatureMatch& match : s.matches) std::swap(match.point1, match.point2);
    return s;
  }
};

struct PairSettings {
  int num_inliers = 150;
  int num_outliers = 50;
  double noise_px = 0.3;
  double depth_noise = 0.02;  // relative
  double focal1_px = 1000.0;
  double focal2_px = 1200.0;
  double distortion = 0.0;  // of camera 2: SIMPLE_RADIAL
};

inline Camera MakeCamera(camera_t id, double focal_px, double distortion) {
  Camera camera = Camera::FromFocal(id, CameraModel::kSimpleRadial, focal_px, 1600, 1600);
  camera.params.back() = distortion;
  camera.has_prior_focal_length = true;
  return camera;
}

// Frame, depth and depth gradient of a patch as the camera sees it.
inline void AddView(const Camera& camera, const NormalizedFrame& frame, const LiftedFrame& lifted,
                    const PairSettings& settings, Rng& rng, std::vector<Keypoint>* keypoints,
                    std::vector<DepthSample>* depth) {
  Eigen::Matrix2d J;
  const Eigen::Vector2d pixel =
      camera.ImgFromCam(frame.point, &J) + settings.noise_px * GaussianVector<2>(rng);
  const Eigen::Matrix2d shape = J * frame.shape;
  Keypoint keypoint;
  keypoint.x = static_cast<float>(pixel.x());
  keypoint.y = static_cast<float>(pixel.y());
  keypoint.a11 = static_cast<float>(shape(0, 0));
  keypoint.a12 = static_cast<float>(shape(0, 1));
  keypoint.a21 = static_cast<float>(shape(1, 0));
  keypoint.a22 = static_cast<float>(shape(1, 1));
  keypoints->push_back(keypoint);
  const Eigen::RowVector2d gradient = lifted.derivative.row(2) * shape.inverse();
  const double factor = 1.0 + settings.depth_noise * rng.Gaussian();
  DepthSample sample;
  sample.depth = static_cast<float>(factor * lifted.point.z());
  sample.ddepth_dx = static_cast<float>(factor * gradient.x());
  sample.ddepth_dy = static_cast<float>(factor * gradient.y());
  sample.is_valid = true;
  depth->push_back(sample);
}

// Matches of a random scene, wrong ones mixed among the right ones.
inline Pair MakePair(const PairSettings& settings, uint64_t seed) {
  Rng rng(seed, "pair");
  Pair pair;
  pair.camera1 = MakeCamera(1, settings.focal1_px, 0.0);
  pair.camera2 = MakeCamera(2, settings.focal2_px, settings.distortion);
  const int n = settings.num_inliers + settings.num_outliers;
  const TwoViewScene scene = RandomScene(rng, n);
  pair.cam2_from_cam1 = scene.cam2_from_cam1;
  pair.cam2_from_cam1.translation.normalize();
  for (int i = 0; i < n; ++i) {
    const Patch& patch = scene.patches[i];
    AddView(pair.camera1, patch.affine.frame1, patch.lifted.frame1, settings, rng, &pair.keypoints1,
            &pair.depth1);
    AddView(pair.camera2, patch.affine.frame2, patch.lifted.frame2, settings, rng, &pair.keypoints2,
            &pair.depth2);
    pair.matches.push_back({static_cast<point2D_t>(i), static_cast<point2D_t>(i)});
    pair.is_inlier.push_back(true);
  }
  // Outliers: second points moved on by one among the last ones.
  for (int i = settings.num_inliers; i < n; ++i) {
    pair.matches[i].point2 = static_cast<point2D_t>(
        settings.num_inliers + (i - settings.num_inliers + 1) % settings.num_outliers);
    pair.is_inlier[i] = settings.num_outliers == 1;
  }
  for (size_t i = pair.matches.size(); i > 1; --i) {
    const uint32_t k = rng.UniformInt(static_cast<uint32_t>(i));
    std::swap(pair.matches[i - 1], pair.matches[k]);
    const bool flag = pair.is_inlier[i - 1];
    pair.is_inlier[i - 1] = pair.is_inlier[k];
    pair.is_inlier[k] = flag;
  }
  return pair;
}

// Points of one plane, or (distance infinite: zero translation) of a pure rotation; with
// similarity frames and no depth.
inline Pair MakePlanarPair(const Rigid3d& cam2_from_cam1, bool rotation_only, int num_points,
                           double noise_px, uint64_t seed) {
  Rng rng(seed, "plane");
  Pair pair;
  pair.camera1 = MakeCamera(1, 1000.0, 0.0);
  pair.camera2 = MakeCamera(2, 1000.0, 0.0);
  pair.cam2_from_cam1 = cam2_from_cam1;
  if (rotation_only) pair.cam2_from_cam1.translation.setZero();
  const Eigen::Vector3d normal = Eigen::Vector3d(0.2, -0.3, 1.0).normalized();
  auto add = [&](const Eigen::Vector2d& pixel, std::vector<Keypoint>* keypoints) {
    keypoints->push_back(RoundKeypoint(pixel + noise_px * GaussianVector<2>(rng)));
  };
  while (static_cast<int>(pair.matches.size()) < num_points) {
    const Eigen::Vector3d ray = UniformVector({{-0.6, 0.6}, {-0.6, 0.6}}, rng).homogeneous();
    const Eigen::Vector3d X2 = pair.cam2_from_cam1 * Eigen::Vector3d(ray * (4.0 / normal.dot(ray)));
    if (X2.z() <= 0.5 || (X2.head<2>() / X2.z()).cwiseAbs().maxCoeff() > 0.75) continue;
    const auto i = static_cast<point2D_t>(pair.matches.size());
    add(pair.camera1.ImgFromCam(ray.head<2>()), &pair.keypoints1);
    add(pair.camera2.ImgFromCam(X2.hnormalized()), &pair.keypoints2);
    pair.matches.push_back({i, i});
    pair.is_inlier.push_back(true);
  }
  return pair;
}

// What a verifier gets of the problem, which must outlive it, without depth.
inline PairInput InputByFrames(const TwoViewProblem& problem) {
  PairInput input;
  input.camera1 = &problem.camera1;
  input.camera2 = &problem.camera2;
  input.keypoints1 = problem.keypoints1;
  input.keypoints2 = problem.keypoints2;
  input.matches = problem.matches;
  return input;
}

inline double PoseErrorDeg(const PairReport& report, const Pair& pair) {
  if (!report.geometry.cam2_from_cam1) return 180.0;
  return PoseError(*report.geometry.cam2_from_cam1, pair.cam2_from_cam1) * 180.0 / M_PI;
}

}  // namespace cairn
