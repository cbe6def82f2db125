#include "two_view/search/search_steps.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <limits>

#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "cairn/solvers/five_point.h"
#include "cairn/solvers/one_affine_depth_batch.h"
#include "cairn/solvers/two_affine.h"

namespace cairn::internal {
namespace {

// The keypoint's frame in normalized coordinates (x / z, y / z) at its ray, whose third component
// is 1, or -1 where it points backward.
NormalizedFrame NormalizeFrame(const Camera& camera, const Keypoint& keypoint,
                               const Eigen::Vector3d& ray) {
  const Eigen::Vector2d x = ray.z() * ray.head<2>();
  Eigen::Matrix2d dpixel_dx = Eigen::Matrix2d::Zero();  // at a lens's very limit: no shape
  if (camera.IsPlanar()) {
    camera.ImgFromCam(x, &dpixel_dx);
  } else {
    Eigen::Matrix<double, 2, 3> dpixel_dray = Eigen::Matrix<double, 2, 3>::Zero();
    camera.ImgFromRay(ray, &dpixel_dray);
    dpixel_dx = ray.z() * dpixel_dray.leftCols<2>();
  }
  return {x, dpixel_dx.inverse() * keypoint.Shape()};
}

AffineCorrespondence Frames(const PreparedPair& pair, int i) {
  return {NormalizeFrame(*pair.input.camera1, pair.Keypoint1(i), pair.points.Ray1(i)),
          NormalizeFrame(*pair.input.camera2, pair.Keypoint2(i), pair.points.Ray2(i))};
}

// LiftFrame (solvers/affine_frame.h) of a keypoint whose normalized frame is known already.
LiftedFrame Lift(const NormalizedFrame& frame, const Keypoint& keypoint,
                 const DepthSample& sample) {
  const double gradient1 = sample.ddepth_dx * keypoint.a11 + sample.ddepth_dy * keypoint.a21;
  const double gradient2 = sample.ddepth_dx * keypoint.a12 + sample.ddepth_dy * keypoint.a22;
  LiftedFrame lifted;
  lifted.point = sample.depth * frame.point.homogeneous();
  lifted.derivative.col(0) = gradient1 * frame.point.homogeneous();
  lifted.derivative.col(1) = gradient2 * frame.point.homogeneous();
  lifted.derivative.topRows<2>() += sample.depth * frame.shape;
  return lifted;
}

// Has match i z-depth in both images? (Points behind a camera have none.)
bool HasDepth(const PreparedPair& pair, int i) {
  return pair.Depth1(i).is_valid && pair.Depth2(i).is_valid && !pair.points.IsBehind1(i) &&
         !pair.points.IsBehind2(i);
}

void AddSolutions(const OneAffineDepthBatch& batch, int count, PoseSearch* search) {
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  for (int i = 0; i < count; ++i) {
    if (batch.Get(i, &R, &t)) search->Add(CrossMatrix(t) * R);
  }
}

// Three matches with depth.
struct Triangle {
  std::array<uint32_t, 3> index;  // into points
  float distortion;  // largest over smallest of the squared ratios of its edges, at least 1
};
using PointsInBoth = std::array<Eigen::Vector3f, 2>;

Triangle Measure(const std::vector<PointsInBoth>& points, const std::array<uint32_t, 3>& index) {
  float smallest = std::numeric_limits<float>::infinity(), largest = 0.0f;
  for (int k = 0; k < 3; ++k) {
    const PointsInBoth& a = points[index[k]];
    const PointsInBoth& b = points[index[(k + 1) % 3]];
    const float ratio = (a[1] - b[1]).squaredNorm() / (a[0] - b[0]).squaredNorm();
    smallest = std::min(smallest, ratio);
    largest = std::max(largest, ratio);
  }
  const float distortion = largest / smallest;
  return {index, distortion >= 1.0f ? distortion : std::numeric_limits<float>::infinity()};
}

// The least distorted of `count` random triangles.
std::vector<Triangle> DrawTriangles(const std::vector<PointsInBoth>& points, int count, Rng* rng) {
  constexpr int kDrawnPerScored = 4;
  std::vector<Triangle> triangles;
  triangles.reserve(count);
  for (int k = 0; k < count; ++k) {
    std::array<uint32_t, 3> index;
    rng->Sample(static_cast<uint32_t>(points.size()), 3, index.data());
    triangles.push_back(Measure(points, index));
  }
  const int num_scored = (count + kDrawnPerScored - 1) / kDrawnPerScored;
  std::nth_element(triangles.begin(), triangles.begin() + (num_scored - 1), triangles.end(),
                   [](const Triangle& a, const Triangle& b) {
                     return a.distortion < b.distortion ||
                            (a.distortion == b.distortion && a.index < b.index);
                   });
  triangles.resize(num_scored);
  return triangles;
}

LiftedFrame FrameOf(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  LiftedFrame frame;
  frame.point = ((a + b + c) / 3.0f).cast<double>();
  frame.derivative.col(0) = (b - a).cast<double>();
  frame.derivative.col(1) = (c - a).cast<double>();
  return frame;
}

// Samples are drawn in turns from the matches that have votes, and from all; or rather than from
// all from the best half, quarter and eighth of them, where that is known (the idea of PROSAC: Chum
// and Matas, CVPR 2005).
void DrawSample(const PreparedPair& pair, int64_t turn, int sample_size, Rng* rng,
                uint32_t* sample) {
  const auto size = static_cast<uint32_t>(sample_size);
  if (turn % 2 == 0 && pair.NumSupported() >= 2 * sample_size) {
    rng->Sample(static_cast<uint32_t>(pair.NumSupported()), size, sample);
    return;
  }
  constexpr int kNumParts = 3;
  const auto num_best = static_cast<uint32_t>(pair.best_first.size() >> (1 + turn / 2 % kNumParts));
  if (num_best < 4 * size) {
    rng->Sample(static_cast<uint32_t>(pair.size()), size, sample);
    return;
  }
  rng->Sample(num_best, size, sample);
  for (uint32_t k = 0; k < size; ++k) sample[k] = pair.best_first[sample[k]];
}

struct Sampling {
  int max_num_samples;
  int batch;        // samples after which the best hypotheses are refined
  int num_refined;  // of a batch
};

// Samples of a minimal solver, of whatever correspondence(i) is of match i.
template <class Solver, class Correspondence>
void RunSamples(const PreparedPair& pair, const Sampling& sampling, Rng rng,
                const Correspondence& correspondence, PoseSearch* search) {
  constexpr int kSampleSize = Solver::kSampleSize;
  if (pair.size() < kSampleSize) return;
  typename Solver::Model models[Solver::kMaxSolutions];
  for (int turn = 0; turn < sampling.max_num_samples && !search->HasConverged(); ++turn) {
    uint32_t sample[kSampleSize];
    DrawSample(pair, turn, kSampleSize, &rng, sample);
    typename Solver::Sample correspondences[kSampleSize];
    for (int k = 0; k < kSampleSize; ++k) {
      correspondences[k] = correspondence(static_cast<int>(sample[k]));
    }
    const int count = Solver::Solve(correspondences, models);
    for (int k = 0; k < count; ++k) search->Add(models[k]);
    if (turn % sampling.batch == sampling.batch - 1 || turn + 1 == sampling.max_num_samples) {
      search->RefineBest(sampling.num_refined);
    }
  }
}

}  // namespace

int RunOneAcDepthStep(const PreparedPair& pair, int max_num_refined, PoseSearch* search) {
  if (!pair.HasDepth()) return 0;
  OneAffineDepthBatch batch;
  batch.Reset(std::min(pair.size(), kEnoughMatches));
  int count = 0;
  for (int i = 0; i < pair.size() && count < batch.size(); ++i) {
    if (!HasDepth(pair, i)) continue;
    const AffineCorrespondence frames = Frames(pair, i);
    batch.Set(count++, Lift(frames.frame1, pair.Keypoint1(i), pair.Depth1(i)),
              Lift(frames.frame2, pair.Keypoint2(i), pair.Depth2(i)));
  }
  for (int i = count; i < batch.size(); ++i) batch.Set(i, {}, {});
  batch.Solve();
  AddSolutions(batch, count, search);
  search->RefineBest(max_num_refined);
  return count;
}

void RunTriangleStep(const PreparedPair& pair, int max_num_samples, PoseSearch* search) {
  constexpr int kMaxRefined = 24;
  if (!pair.HasDepth()) return;
  std::vector<PointsInBoth> points;
  for (int i = 0; i < std::min(pair.size(), kEnoughMatches); ++i) {
    if (!HasDepth(pair, i)) continue;
    points.push_back({(pair.Depth1(i).depth * pair.points.Point1(i).homogeneous()).cast<float>(),
                      (pair.Depth2(i).depth * pair.points.Point2(i).homogeneous()).cast<float>()});
  }
  if (points.size() < 3) return;
  Rng rng(pair.input.seed, "triangles", pair.input.pair_id);
  const std::vector<Triangle> triangles = DrawTriangles(points, max_num_samples, &rng);
  OneAffineDepthBatch batch;
  batch.Reset(static_cast<int>(triangles.size()));
  for (size_t k = 0; k < triangles.size(); ++k) {
    const auto& [i, j, l] = triangles[k].index;
    batch.Set(static_cast<int>(k), FrameOf(points[i][0], points[j][0], points[l][0]),
              FrameOf(points[i][1], points[j][1], points[l][1]));
  }
  batch.Solve();
  AddSolutions(batch, batch.size(), search);
  search->RefineBest(kMaxRefined);
}

void RunTwoAcStep(const PreparedPair& pair, int max_num_samples, PoseSearch* search) {
  RunSamples<TwoAffineFivePoint>(
      pair, {max_num_samples, 10, 3}, Rng(pair.input.seed, "two_ac", pair.input.pair_id),
      [&](int i) { return Frames(pair, i); }, search);
}

void RunFivePointStep(const PreparedPair& pair, int max_num_samples, PoseSearch* search) {
  RunSamples<FivePoint>(
      pair, {max_num_samples, 20, 2}, Rng(pair.input.seed, "five_point", pair.input.pair_id),
      [&](int i) { return pair.Points(i); }, search);
}

}  // namespace cairn::internal
