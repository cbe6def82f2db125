#include <algorithm>
#include <cmath>

#include "cairn/evaluation/alignment.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// The similarity that puts the images of the model where they were: the rotation that most cameras
// agree on, then scale and shift with the least sum of distances (20 reweighted rounds).
Sim3d OldFromNew(const Reconstruction& model, const Reconstruction& earlier) {
  std::vector<Eigen::Quaterniond> rotations, earlier_rotations;
  std::vector<Eigen::Vector3d> centers, earlier_centers;
  for (const auto& [id, image] : earlier.images) {
    const auto now = model.images.find(id);
    if (now == model.images.end()) continue;
    rotations.push_back(now->second.cam_from_world.rotation);
    centers.push_back(now->second.cam_from_world.Center());
    earlier_rotations.push_back(image.cam_from_world.rotation);
    earlier_centers.push_back(image.cam_from_world.Center());
  }
  Sim3d frame;
  frame.rotation = AlignRotationsL1(rotations, earlier_rotations).value_or(frame.rotation);
  for (Eigen::Vector3d& center : centers) center = frame.rotation * center;
  std::vector<double> weights(centers.size(), 1.0);
  for (int round = 0; round < 20; ++round) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero(), earlier_mean = mean;
    double sum = 0, product = 0, square = 0;
    for (size_t i = 0; i < centers.size(); ++i) {
      mean += weights[i] * centers[i];
      earlier_mean += weights[i] * earlier_centers[i];
      sum += weights[i];
    }
    mean /= sum;
    earlier_mean /= sum;
    for (size_t i = 0; i < centers.size(); ++i) {
      const Eigen::Vector3d arm = centers[i] - mean;
      product += weights[i] * arm.dot(earlier_centers[i] - earlier_mean);
      square += weights[i] * arm.squaredNorm();
    }
    frame.scale = product > 0 && square > 0 ? product / square : 1.0;
    frame.translation = earlier_mean - frame.scale * mean;
    std::vector<double> distances;
    for (size_t i = 0; i < centers.size(); ++i) {
      const Eigen::Vector3d center = frame.scale * centers[i] + frame.translation;
      distances.push_back((center - earlier_centers[i]).norm());
    }
    const double floor = std::max(1e-6 * UpperMedian(distances), 1e-300);
    for (size_t i = 0; i < centers.size(); ++i) weights[i] = 1.0 / std::max(distances[i], floor);
  }
  return frame;
}

}  // namespace

std::vector<std::string> KeepFrame(StageContext& context, const Reconstruction& earlier,
                                   const std::map<image_t, PoseConfidence>& confidences,
                                   Reconstruction& model) {
  ModelStage stage(context, "movement");
  model.Transform(OldFromNew(model, earlier));
  std::vector<double> turns, shifts;
  for (const auto& [id, image] : earlier.images) {
    const auto now = model.images.find(id);
    if (now == model.images.end()) continue;
    const PoseConfidence& c = confidences.at(id);
    turns.push_back(
        RadToDeg(AngleBetween(image.cam_from_world.rotation, now->second.cam_from_world.rotation)) /
        c.rotation_sigma_deg);
    shifts.push_back((image.cam_from_world.Center() - now->second.cam_from_world.Center()).norm() /
                     c.position_sigma);
    fprintf(stderr, "%s %g %g\n", image.image.name.c_str(), turns.back(), shifts.back());
  }
  stage.Add("median_turn", UpperMedian(turns));
  stage.Add("median_shift", UpperMedian(shifts));
  return {};
}

}  // namespace cairn
