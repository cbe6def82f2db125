// A pair of images with changed numbers: what VerifyPair accepts, and every verifier behind it,
// ends with a report.
#include "cairn/two_view/verify_pair.h"

#include "cairn/base/check.h"
#include "fuzz/input.h"
#include "fuzz/targets.h"
#include "support/two_view_problem.h"

namespace cairn::fuzz {
namespace {

constexpr int kMaxPairChanges = 6;
constexpr double kNumbers[] = {0.0,  1e-300, 1e-30, -1e30, 1e30, 1e300, HUGE_VAL, NAN,
                               -1.0, 1e-6,   1e6,   0.5,   320,  3e38,  1e-45,    -0.0};

// The matched points of one image.
struct Side {
  Camera camera;
  std::vector<Eigen::Vector2d> points;
  std::vector<Eigen::Matrix2d> frames;
  std::vector<DepthSample> depths;

  MatchedPoints Matched(bool with_frames, bool with_depths) const {
    MatchedPoints matched{camera, points};
    if (with_frames) matched.frames = frames;
    if (with_depths) matched.depths = depths;
    return matched;
  }
};

// As the problem's matches join its keypoints.
void AddPoint(const Keypoint& keypoint, const DepthSample& depth, Side& side) {
  side.points.push_back(keypoint.Position());
  side.frames.push_back(keypoint.Shape());
  side.depths.push_back(depth);
}

struct Pair {
  Side side1, side2;
};

Pair MakePair() {
  TwoViewProblemOptions options;
  options.num_matches = 40;
  options.outlier_ratio = 0.3;
  options.missing_depth_ratio = 0.2;
  options.noise.image_px = 0.3;
  const TwoViewProblem problem = MakeTwoViewProblem(options, 1);
  Pair pair;
  pair.side1.camera = problem.camera1;
  pair.side2.camera = problem.camera2;
  for (const FeatureMatch& match : problem.matches) {
    AddPoint(problem.keypoints1[match.point1], problem.depth1[match.point1], pair.side1);
    AddPoint(problem.keypoints2[match.point2], problem.depth2[match.point2], pair.side2);
  }
  return pair;
}

double TakeNumber(Bytes& bytes, double old) {
  switch (bytes.TakeIndex(4)) {
    case 0:
      return kNumbers[bytes.TakeIndex(std::size(kNumbers))];
    case 1:
      return bytes.Take<double>();
    case 2:
      return bytes.Take<int16_t>();
    default:
      return old * kNumbers[bytes.TakeIndex(std::size(kNumbers))];
  }
}

void Change(Bytes& bytes, Side& side) {
  const auto change = [&bytes](auto& value) {
    const double number = TakeNumber(bytes, value);
    value = std::abs(number) > 3.4e38 ? static_cast<float>(HUGE_VAL) : static_cast<float>(number);
  };
  const size_t i = bytes.TakeIndex(side.points.size());
  switch (bytes.TakeIndex(8)) {
    case 0:
      return change(side.camera.params[bytes.TakeIndex(side.camera.params.size())]);
    case 1:
      return change(side.points[i][bytes.TakeIndex(2)]);
    case 2:
      return change(side.frames[i](bytes.TakeIndex(2), bytes.TakeIndex(2)));
    case 3:
      return change(side.depths[i].depth);
    case 4:
      return change(side.depths[i].ddepth_dx);
    case 5:  // many equal points
      std::fill_n(side.points.begin(), i, side.points[i]);
      return;
    case 6:
      std::fill_n(side.frames.begin(), i, side.frames[i]);
      return;
    default:  // few points
      side.points.resize(i);
      side.frames.resize(i);
      side.depths.resize(i);
  }
}

void CheckReport(const PairReport& report, size_t num_points) {
  CAIRN_CHECK(report.num_inliers >= 0 && report.num_inliers <= static_cast<int>(num_points));
  if (report.status != PairStatus::kVerified) return;
  for (const FeatureMatch& match : report.geometry.inlier_matches) {
    CAIRN_CHECK_LT(match.point1, num_points);
  }
  if (!report.geometry.cam2_from_cam1) return;
  const Rigid3d& pose = *report.geometry.cam2_from_cam1;
  CAIRN_CHECK(std::abs(pose.rotation.norm() - 1.0) < 1e-6);
  CAIRN_CHECK(pose.translation.allFinite());
}

}  // namespace

void FuzzVerifyPair(std::string_view input) {
  static const Pair original = MakePair();
  Pair pair = original;
  Bytes bytes(input);
  const auto kind = static_cast<VerifierKind>(bytes.TakeIndex(5));
  const uint8_t flags = bytes.Take<uint8_t>();
  for (Side* side : {&pair.side1, &pair.side2}) {
    side->camera.has_prior_focal_length = (flags & 1) != 0;
  }
  for (int i = 0; i < kMaxPairChanges && !bytes.IsEmpty(); ++i) {
    Side& side = bytes.TakeIndex(2) == 0 ? pair.side1 : pair.side2;
    if (side.points.empty()) break;
    Change(bytes, side);
  }
  VerifyPairOptions options{.verifier = kind, .are_best_first = (flags & 8) != 0};
  options.verification.min_iterations = 20;  // more inputs instead of more samples
  options.verification.max_iterations = 100;
  const bool with_frames = (flags & 2) == 0, with_depths = (flags & 4) == 0;
  ReadOrRefuse([&] {
    const PairReport report = VerifyPair(pair.side1.Matched(with_frames, with_depths),
                                         pair.side2.Matched(with_frames, with_depths), options);
    CheckReport(report, pair.side1.points.size());
  });
}

}  // namespace cairn::fuzz
