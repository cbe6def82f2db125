#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "cairn/base/parallel.h"
#include "cairn/evaluation/alignment.h"
#include "cairn/math/median.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// How far the points that an image sees in a finished model lie from its keypoints by its pose in a
// rough one, median, pixels (over Camera::ErrorScale).
double ShiftPx(const Reconstruction& finished, const Sim3d& rough_from_finished,
               const Reconstruction& rough, const RegisteredImage& image) {
  const RegisteredImage& seen = finished.images.at(image.image.image_id);
  const Camera& camera = rough.CameraOf(image);
  std::vector<double> shifts;
  for (size_t i = 0; i < seen.point3D_ids.size(); ++i) {
    if (seen.point3D_ids[i] == kInvalidPoint3DId) continue;
    const Eigen::Vector3d point =
        rough_from_finished * finished.points3D.at(seen.point3D_ids[i]).xyz;
    shifts.push_back(ReprojectionErrorPx(camera, image.cam_from_world, point, seen.points2D[i]));
  }
  return shifts.empty() ? std::numeric_limits<double>::infinity()
                        : UpperMedian(shifts) / camera.ErrorScale();
}

}  // namespace

Sim3d FrameOf(const Reconstruction& other, const Reconstruction& model,
              std::span<const image_t> ids) {
  std::vector<Eigen::Quaterniond> rotations, other_rotations;
  std::vector<Eigen::Vector3d> centers, other_centers;
  for (const image_t id : ids) {
    const Rigid3d& pose = model.images.at(id).cam_from_world;
    const Rigid3d& other_pose = other.images.at(id).cam_from_world;
    rotations.push_back(pose.rotation);
    centers.push_back(pose.Center());
    other_rotations.push_back(other_pose.rotation);
    other_centers.push_back(other_pose.Center());
  }
  Sim3d frame;
  frame.rotation = AlignRotationsL1(rotations, other_rotations).value_or(frame.rotation);
  for (Eigen::Vector3d& center : centers) center = frame.rotation * center;
  std::vector<double> weights(centers.size(), 1.0);
  for (int round = 0; round < 20; ++round) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero(), other_mean = mean;
    double sum = 0, product = 0, square = 0;
    for (size_t i = 0; i < centers.size(); ++i) {
      mean += weights[i] * centers[i];
      other_mean += weights[i] * other_centers[i];
      sum += weights[i];
    }
    mean /= sum;
    other_mean /= sum;
    for (size_t i = 0; i < centers.size(); ++i) {
      const Eigen::Vector3d arm = centers[i] - mean;
      product += weights[i] * arm.dot(other_centers[i] - other_mean);
      square += weights[i] * arm.squaredNorm();
    }
    frame.scale = product > 0 && square > 0 ? product / square : 1.0;
    frame.translation = other_mean - frame.scale * mean;
    std::vector<double> distances;
    for (size_t i = 0; i < centers.size(); ++i) {
      const Eigen::Vector3d center = frame.scale * centers[i] + frame.translation;
      distances.push_back((center - other_centers[i]).norm());
    }
    const double floor = std::max(1e-6 * UpperMedian(distances), 1e-300);
    for (size_t i = 0; i < centers.size(); ++i) weights[i] = 1.0 / std::max(distances[i], floor);
  }
  const bool is_finite = std::isfinite(frame.scale) && frame.translation.allFinite();
  return is_finite ? frame : Sim3d();
}

bool LeadsTo(const StageContext& context, const Reconstruction& finished,
             const Reconstruction& rough) {
  std::vector<image_t> ids;
  for (const auto& [id, image] : rough.images) {
    if (!finished.images.contains(id)) return false;
    ids.push_back(id);
  }
  const Sim3d rough_from_finished = FrameOf(rough, finished, ids);
  std::atomic<int> num_apart = 0;
  ParallelFor(context.run.num_threads, std::ssize(ids), [&](int64_t i) {
    const double shift = ShiftPx(finished, rough_from_finished, rough, rough.images.at(ids[i]));
    if (!(shift <= context.settings.triangulation.max_error_px)) ++num_apart;
  });
  return !ids.empty() && num_apart == 0;
}

}  // namespace cairn
