#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "cairn/base/check.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/synthetic/scene.h"
#include "synthetic/visible_points.h"

namespace cairn {
namespace {

// Keypoints that are in no match of `used`, in a random order.
std::vector<point2D_t> FreeKeypoints(size_t num_keypoints, const FeatureMatches& used,
                                     point2D_t FeatureMatch::*side, Rng& rng) {
  std::vector<bool> is_used(num_keypoints, false);
  for (const FeatureMatch& match : used) is_used[match.*side] = true;
  std::vector<point2D_t> free;
  for (size_t k = 0; k < num_keypoints; ++k) {
    if (!is_used[k]) free.push_back(static_cast<point2D_t>(k));
  }
  rng.Shuffle(free);
  return free;
}

// The scene point that a keypoint shows, or kInvalidPoint3DId.
point3D_t PointOf(const SyntheticScene& scene, image_t image_id, point2D_t keypoint) {
  const auto it = scene.truth.images.find(image_id);
  return it == scene.truth.images.end() ? kInvalidPoint3DId : it->second.point3D_ids[keypoint];
}

Rigid3d RelativePose(const RegisteredImage& image1, const RegisteredImage& image2) {
  Rigid3d pose = image2.cam_from_world * Inverse(image1.cam_from_world);
  const double length = pose.translation.norm();
  if (length > 0) pose.translation /= length;
  return pose;
}

}  // namespace

VisiblePoints FindVisiblePoints(const SyntheticScene& scene, image_t image_id) {
  VisiblePoints visible;
  const auto it = scene.truth.images.find(image_id);
  if (it == scene.truth.images.end()) return visible;  // a distractor
  const std::vector<point3D_t>& ids = it->second.point3D_ids;
  for (size_t k = 0; k < ids.size(); ++k) {
    if (ids[k] != kInvalidPoint3DId) visible.emplace_back(ids[k], static_cast<point2D_t>(k));
  }
  std::sort(visible.begin(), visible.end());
  return visible;
}

FeatureMatches CommonPoints(const VisiblePoints& visible1, const VisiblePoints& visible2) {
  FeatureMatches matches;
  auto a = visible1.begin();
  auto b = visible2.begin();
  while (a != visible1.end() && b != visible2.end()) {
    if (a->first < b->first) {
      ++a;
    } else if (b->first < a->first) {
      ++b;
    } else {
      matches.push_back({(a++)->second, (b++)->second});
    }
  }
  return matches;
}

SyntheticMatches MakeMatches(const SyntheticScene& scene, image_t image_id1, image_t image_id2,
                             const VisiblePoints& visible1, const VisiblePoints& visible2) {
  CAIRN_CHECK_LT(image_id1, image_id2);
  Rng rng(scene.seed, "scene_matches", ImagePairToPairId(image_id1, image_id2));
  const size_t num_keypoints1 = scene.keypoints.at(image_id1).size();
  const size_t num_keypoints2 = scene.keypoints.at(image_id2).size();
  FeatureMatches correct = CommonPoints(visible1, visible2);
  if (correct.size() < 2) correct.clear();
  rng.Shuffle(correct);

  // As many matches as the correct ones allow at this share; fewer if the keypoints do not suffice.
  size_t num_outliers = scene.options.num_chance_matches;
  if (!correct.empty()) {
    const double ratio = scene.options.outlier_ratio;
    const double total =
        std::min({correct.size() / (1.0 - ratio), double(num_keypoints1), double(num_keypoints2)});
    correct.resize(std::min<size_t>(correct.size(), std::lround((1.0 - ratio) * total)));
    num_outliers = std::lround(ratio * total);
  }
  if (correct.empty() && num_outliers == 0) return {};
  const auto free1 = FreeKeypoints(num_keypoints1, correct, &FeatureMatch::point1, rng);
  const auto free2 = FreeKeypoints(num_keypoints2, correct, &FeatureMatch::point2, rng);

  std::vector<std::pair<FeatureMatch, bool>> matches;  // and whether they are correct
  for (const FeatureMatch& match : correct) matches.emplace_back(match, true);
  for (size_t i = 0; i < std::min({num_outliers, free1.size(), free2.size()}); ++i) {
    // By chance two free keypoints may show the same point: such a pair is left out.
    const point3D_t point1 = PointOf(scene, image_id1, free1[i]);
    if (point1 != kInvalidPoint3DId && point1 == PointOf(scene, image_id2, free2[i])) continue;
    matches.emplace_back(FeatureMatch{free1[i], free2[i]}, false);
  }
  rng.Shuffle(matches);
  SyntheticMatches out;
  for (const auto& [match, is_correct] : matches) {
    out.matches.push_back(match);
    out.is_inlier.push_back(is_correct);
  }
  return out;
}

SyntheticMatches MakeMatches(const SyntheticScene& scene, image_t image_id1, image_t image_id2) {
  return MakeMatches(scene, image_id1, image_id2, FindVisiblePoints(scene, image_id1),
                     FindVisiblePoints(scene, image_id2));
}

TwoViewGeometry TrueTwoViewGeometry(const SyntheticScene& scene, image_t image_id1,
                                    image_t image_id2, const SyntheticMatches& matches) {
  const RegisteredImage& image1 = scene.truth.images.at(image_id1);
  const RegisteredImage& image2 = scene.truth.images.at(image_id2);
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kCalibrated;
  geometry.cam2_from_cam1 = RelativePose(image1, image2);
  geometry.E = EssentialFromPose(*geometry.cam2_from_cam1);
  geometry.F =
      FundamentalFromEssential(*geometry.E, scene.truth.CameraOf(image1).CalibrationMatrix(),
                               scene.truth.CameraOf(image2).CalibrationMatrix());
  for (size_t i = 0; i < matches.matches.size(); ++i) {
    if (matches.is_inlier[i]) geometry.inlier_matches.push_back(matches.matches[i]);
  }
  return geometry;
}

}  // namespace cairn
