#include "cairn/evaluation/pose_evaluation.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "cairn/base/rng.h"
#include "cairn/evaluation/alignment.h"
#include "cairn/math/angles.h"

namespace cairn {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string BaseName(const std::string& name) { return name.substr(name.rfind('/') + 1); }

// An image of the reference with its counterpart, if it was registered.
struct Match {
  const PosedCamera* reference;
  const PosedCamera* estimate;  // null: not registered
  ImageErrors* errors;
};

// By the last part of their path, those without a counterpart of their name; null: several.
std::map<std::string, const PosedCamera*> ByBaseName(const PosedCameras& cameras,
                                                     const PosedCameras& counterparts) {
  std::map<std::string, const PosedCamera*> by_base_name;
  for (const auto& [name, camera] : cameras) {
    if (counterparts.contains(name)) continue;
    const auto [it, is_new] = by_base_name.emplace(BaseName(name), &camera);
    if (!is_new) it->second = nullptr;
  }
  return by_base_name;
}

// All images of the reference, with a place for their errors.
std::vector<Match> MatchNames(const PosedCameras& estimate, const PosedCameras& reference,
                              std::vector<ImageErrors>& errors) {
  const auto estimates = ByBaseName(estimate, reference);
  const auto references = ByBaseName(reference, estimate);
  std::vector<Match> matches;
  errors.resize(reference.size());
  for (const auto& [name, camera] : reference) {
    const PosedCamera* found = nullptr;
    if (const auto exact = estimate.find(name); exact != estimate.end()) {
      found = &exact->second;
    } else if (references.at(BaseName(name)) == &camera) {
      const auto other = estimates.find(BaseName(name));
      if (other != estimates.end()) found = other->second;
    }
    ImageErrors& of_image = errors[matches.size()];
    of_image.name = name;
    of_image.registered = found != nullptr;
    matches.push_back({&camera, found, &of_image});
  }
  return matches;
}

// Two cameras in one place have no direction, which is right if they are
// in one place in both.
double DirectionErrorDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  constexpr double kZero = 1e-12;
  if (!(a.norm() >= kZero) || !(b.norm() >= kZero)) {  // or no numbers
    return a.norm() < kZero && b.norm() < kZero ? 0.0 : 180.0;
  }
  return RadToDeg(AngleBetween(a, b));
}

Eigen::Vector3d CenterInFrameOf(const PosedCamera& other, const PosedCamera& camera) {
  return camera.cam_from_world.rotation *
         (other.cam_from_world.Center() - camera.cam_from_world.Center());
}

// Of more pairs of images, a random sample of so many tells the errors to a hundredth of a percent.
constexpr size_t kMaxPairs = 50'000'000;

void ForPairs(size_t num, const std::function<void(size_t, size_t)>& fn) {
  if (num * (num - 1) / 2 > kMaxPairs) {
    Rng rng(0, "evaluated_pairs");
    for (size_t k = 0; k < kMaxPairs; ++k) {
      const uint32_t i = rng.UniformInt(static_cast<uint32_t>(num));
      const uint32_t j = rng.UniformInt(static_cast<uint32_t>(num - 1));
      fn(i, j < i ? j : j + 1);
    }
    return;
  }
  for (size_t i = 0; i < num; ++i) {
    for (size_t j = i + 1; j < num; ++j) fn(i, j);
  }
}

void EvaluatePairs(const std::vector<Match>& matches, PoseEvaluation& evaluation) {
  std::vector<double> rotation, translation, pose;
  ForPairs(matches.size(), [&](size_t i, size_t j) {
    if (!matches[i].estimate || !matches[j].estimate) {
      pose.push_back(kInfinity);
      return;
    }
    const auto relative = [](const PosedCamera* a, const PosedCamera* b) {
      return b->cam_from_world.rotation * a->cam_from_world.rotation.conjugate();
    };
    rotation.push_back(RadToDeg(AngleBetween(relative(matches[i].reference, matches[j].reference),
                                             relative(matches[i].estimate, matches[j].estimate))));
    translation.push_back(
        DirectionErrorDeg(CenterInFrameOf(*matches[j].reference, *matches[i].reference),
                          CenterInFrameOf(*matches[j].estimate, *matches[i].estimate)));
    pose.push_back(std::max(rotation.back(), translation.back()));
  });
  std::sort(pose.begin(), pose.end());
  for (size_t k = 0; k < kAucThresholdsDeg.size(); ++k) {
    evaluation.auc[k] = RecallAuc(pose, kAucThresholdsDeg[k]);
  }
  if (rotation.empty()) return;
  evaluation.relative_rotation_median_deg = Median(rotation);
  evaluation.relative_translation_median_deg = Median(translation);
}

void EvaluateCenters(const std::vector<Match>& registered, PoseEvaluation& evaluation) {
  std::vector<Eigen::Vector3d> estimate, reference;
  for (const Match& match : registered) {
    estimate.push_back(match.estimate->cam_from_world.Center());
    reference.push_back(match.reference->cam_from_world.Center());
  }
  const std::optional<Sim3d> reference_from_estimate = AlignSimilarityRobust(estimate, reference);
  if (!reference_from_estimate) return;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& center : reference) mean += center / double(reference.size());
  double extent = 0;
  std::vector<double> errors;
  for (size_t k = 0; k < registered.size(); ++k) {
    errors.push_back((*reference_from_estimate * estimate[k] - reference[k]).norm());
    extent = std::max(extent, (reference[k] - mean).norm());
    registered[k].errors->center = errors.back();
  }
  evaluation.center = ComputeErrorStatistics(errors);
  evaluation.extent = extent;
}

void EvaluateOrientations(const std::vector<Match>& registered, PoseEvaluation& evaluation) {
  std::vector<Eigen::Quaterniond> estimate, reference;
  for (const Match& match : registered) {
    estimate.push_back(match.estimate->cam_from_world.rotation);
    reference.push_back(match.reference->cam_from_world.rotation);
  }
  const auto reference_from_estimate = AlignRotationsL1(estimate, reference);
  if (!reference_from_estimate) return;
  std::vector<double> errors;
  for (size_t k = 0; k < registered.size(); ++k) {
    const Eigen::Quaterniond aligned = estimate[k] * reference_from_estimate->conjugate();
    errors.push_back(RadToDeg(AngleBetween(aligned, reference[k])));
    registered[k].errors->orientation_deg = errors.back();
  }
  evaluation.orientation_deg = ComputeErrorStatistics(errors);
}

void EvaluateFocals(const std::vector<Match>& registered, PoseEvaluation& evaluation) {
  std::vector<double> errors;
  for (const auto& [reference, estimate, of_image] : registered) {
    if (reference->focal_px <= 0 || estimate->focal_px <= 0) continue;
    const bool sizes_known = reference->width > 0 && estimate->width > 0;
    // Where one is unknown, nothing tells whether they are of one size.
    if (!sizes_known && reference->width + estimate->width > 0) continue;
    const double scale = sizes_known ? double(estimate->width) / reference->width : 1.0;
    const double expected = scale * reference->focal_px;
    errors.push_back(std::abs(estimate->focal_px - expected) / expected);
    of_image->focal_relative = errors.back();
  }
  if (!errors.empty()) evaluation.focal_relative = ComputeErrorStatistics(errors);
}

}  // namespace

PosedCameras PosedCamerasOf(const Reconstruction& reconstruction) {
  PosedCameras cameras;
  for (const auto& [id, image] : reconstruction.images) {
    const Camera& camera = reconstruction.CameraOf(image);
    cameras[image.image.name] = {image.cam_from_world, camera.MeanFocal(), camera.width};
  }
  return cameras;
}

PoseEvaluation EvaluatePoses(const PosedCameras& estimate, const PosedCameras& reference) {
  PoseEvaluation evaluation;
  std::vector<Match> matches = MatchNames(estimate, reference, evaluation.images);
  EvaluatePairs(matches, evaluation);
  std::erase_if(matches, [](const Match& match) { return match.estimate == nullptr; });
  evaluation.num_reference = static_cast<int>(reference.size());
  evaluation.num_registered = static_cast<int>(matches.size());
  evaluation.num_extra = static_cast<int>(estimate.size()) - evaluation.num_registered;
  EvaluateCenters(matches, evaluation);
  EvaluateOrientations(matches, evaluation);
  EvaluateFocals(matches, evaluation);
  return evaluation;
}

}  // namespace cairn
