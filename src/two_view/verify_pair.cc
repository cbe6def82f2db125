#include "cairn/two_view/verify_pair.h"

#include <Eigen/LU>
#include <cmath>
#include <string>
#include <vector>

#include "cairn/base/error.h"

namespace cairn {
namespace {

void CheckSize(const std::string& key, size_t size, size_t expected) {
  if (size == expected) return;
  throw ConfigError(key, std::to_string(size) + " are given, but " + std::to_string(expected) +
                             " points in the first image");
}

// Throws for the first value that is wrong.
template <class Value, class IsGood>
void CheckValues(const std::string& key, std::span<const Value> values, const char* reason,
                 const IsGood& is_good) {
  for (size_t i = 0; i < values.size(); ++i) {
    if (!is_good(values[i])) throw ConfigError(key + "[" + std::to_string(i) + "]", reason);
  }
}

bool IsGoodDepth(const DepthSample& sample) {
  if (!sample.is_valid) return true;
  return sample.depth > 0 && std::isfinite(sample.depth) && std::isfinite(sample.ddepth_dx) &&
         std::isfinite(sample.ddepth_dy);
}

void CheckImage(const MatchedPoints& image, const std::string& number, size_t num_points) {
  if (const std::string reason = image.camera.Validate(); !reason.empty()) {
    throw ConfigError("camera" + number, reason);
  }
  CheckSize("points" + number, image.points.size(), num_points);
  if (!image.frames.empty()) CheckSize("frames" + number, image.frames.size(), num_points);
  if (!image.depths.empty()) CheckSize("depths" + number, image.depths.size(), num_points);
  CheckValues("points" + number, image.points, "is not finite",
              [](const Eigen::Vector2d& point) { return point.allFinite(); });
  CheckValues("frames" + number, image.frames, "is not finite, or has no area",
              [](const Eigen::Matrix2d& M) { return M.allFinite() && M.determinant() != 0.0; });
  CheckValues("depths" + number, image.depths, "is valid, but not positive or not finite",
              IsGoodDepth);
}

std::vector<Keypoint> MakeKeypoints(const MatchedPoints& image) {
  std::vector<Keypoint> keypoints(image.points.size());
  for (size_t i = 0; i < keypoints.size(); ++i) {
    Keypoint& keypoint = keypoints[i];
    keypoint.x = static_cast<float>(image.points[i].x());
    keypoint.y = static_cast<float>(image.points[i].y());
    if (image.frames.empty()) continue;
    const Eigen::Matrix2f shape = image.frames[i].cast<float>();
    keypoint.a11 = shape(0, 0);
    keypoint.a12 = shape(0, 1);
    keypoint.a21 = shape(1, 0);
    keypoint.a22 = shape(1, 1);
  }
  return keypoints;
}

}  // namespace

PairReport VerifyPair(const MatchedPoints& image1, const MatchedPoints& image2,
                      const VerifyPairOptions& options, const RunContext& run) {
  const size_t num_points = image1.points.size();
  CheckImage(image1, "1", num_points);
  CheckImage(image2, "2", num_points);
  if (image1.frames.empty() != image2.frames.empty()) {
    throw ConfigError(image1.frames.empty() ? "frames1" : "frames2",
                      "only the other image has any");
  }
  const std::vector<Keypoint> keypoints1 = MakeKeypoints(image1),
                              keypoints2 = MakeKeypoints(image2);
  FeatureMatches matches(num_points);
  for (size_t i = 0; i < num_points; ++i) {
    matches[i].point1 = matches[i].point2 = static_cast<point2D_t>(i);
  }
  PairInput input;
  input.seed = run.seed;
  input.camera1 = &image1.camera;
  input.camera2 = &image2.camera;
  input.keypoints1 = keypoints1;
  input.keypoints2 = keypoints2;
  input.depth1 = image1.depths;
  input.depth2 = image2.depths;
  input.matches = matches;
  input.are_best_first = options.are_best_first;
  return MakePairVerifier(options.verifier, options.verification)->Verify(input);
}

}  // namespace cairn
