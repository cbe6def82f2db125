#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

#include "cairn/base/rng.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/intrinsics/focal_calibration.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"

namespace cairn {

inline constexpr int kFocalTestWidth = 1000;
inline constexpr int kFocalTestHeight = 750;

inline Camera GuessedCamera(camera_t id, double focal_px, bool has_exif = false) {
  Camera camera = Camera::FromFocal(id, CameraModel::kSimplePinhole, focal_px, kFocalTestWidth,
                                    kFocalTestHeight);
  camera.has_prior_focal_length = has_exif;
  return camera;
}

// cam_from_world of a camera that looks at the target, then rolled.
inline Rigid3d Facing(const Eigen::Vector3d& center, const Eigen::Vector3d& target,
                      double roll = 0) {
  Eigen::Matrix3d R;
  R.row(2) = (target - center).normalized();
  R.row(0) = Eigen::Vector3d::UnitY().cross(Eigen::Vector3d(R.row(2))).normalized();
  R.row(1) = R.row(2).cross(R.row(0));
  R = ExpSO3({0, 0, roll}).toRotationMatrix() * R;
  return {Eigen::Quaterniond(R), Eigen::Vector3d(-R * center)};
}

// Images that look at a ball of points from a ring around it, near enough to fill three quarters of
// the image whatever their focal length.
struct Rig {
  Rig(const std::vector<double>& focals, int num_images, uint64_t seed = 1) : rng(seed) {
    for (size_t c = 0; c < focals.size(); ++c) {
      truth[static_cast<camera_t>(c + 1)] = GuessedCamera(static_cast<camera_t>(c + 1), focals[c]);
    }
    for (int i = 0; i < num_images; ++i) {
      camera_of.push_back(static_cast<camera_t>(1 + i % focals.size()));
      const double angle = 2 * std::numbers::pi * i / num_images + rng.Uniform(-0.1, 0.1);
      const double distance = 1.1 * focals[i % focals.size()] / (0.4 * kFocalTestHeight);
      // Optical axes that all meet in one point would leave one of the two equations.
      const Eigen::Vector3d target = UniformVector({{-0.5, 0.5}, {-0.5, 0.5}, {-0.5, 0.5}}, rng);
      const Eigen::Vector3d center(distance * std::sin(angle), rng.Uniform(-0.3, 0.3) * distance,
                                   -distance * std::cos(angle));
      poses.push_back(Facing(center, target, rng.Uniform(-0.2, 0.2)));
    }
    for (int k = 0; k < 150; ++k) {
      Eigen::Vector3d x;
      do {
        x = {rng.Uniform(-1, 1), rng.Uniform(-1, 1), rng.Uniform(-1, 1)};
      } while (x.norm() > 1);
      points.push_back(x);
    }
  }

  FocalPair MakePair(int i, int j, double noise_px = 0.5) {
    FocalPair pair;
    pair.camera_id1 = camera_of[i];
    pair.camera_id2 = camera_of[j];
    const Camera& camera1 = truth.at(camera_of[i]);
    const Camera& camera2 = truth.at(camera_of[j]);
    pair.F = FundamentalFromEssential(EssentialFromPose(poses[j] * Inverse(poses[i])),
                                      camera1.CalibrationMatrix(), camera2.CalibrationMatrix());
    const auto noise = [&]() -> Eigen::Vector2d {
      return {noise_px * rng.Gaussian(), noise_px * rng.Gaussian()};
    };
    for (const Eigen::Vector3d& x : points) {
      pair.pixels1.push_back(camera1.ImgFromCam((poses[i] * x).hnormalized()) + noise());
      pair.pixels2.push_back(camera2.ImgFromCam((poses[j] * x).hnormalized()) + noise());
    }
    return pair;
  }

  std::vector<FocalPair> AllPairs(double noise_px = 0.5) {
    std::vector<FocalPair> pairs;
    for (size_t i = 0; i < poses.size(); ++i) {
      for (size_t j = i + 1; j < poses.size(); ++j) {
        pairs.push_back(MakePair(static_cast<int>(i), static_cast<int>(j), noise_px));
      }
    }
    return pairs;
  }

  // What is known of the cameras before.
  std::map<camera_t, Camera> Guesses(double focal_px, bool has_exif = false) const {
    std::map<camera_t, Camera> guesses;
    for (const auto& [id, camera] : truth) guesses[id] = GuessedCamera(id, focal_px, has_exif);
    return guesses;
  }

  Rng rng;
  std::map<camera_t, Camera> truth;
  std::vector<camera_t> camera_of;  // by image
  std::vector<Rigid3d> poses;
  std::vector<Eigen::Vector3d> points;
};

}  // namespace cairn
