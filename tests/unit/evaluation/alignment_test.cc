#include "cairn/evaluation/alignment.h"

#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "support/test.h"

namespace cairn {
namespace {

Eigen::Vector3d RandomVector(Rng& rng) { return {rng.Gaussian(), rng.Gaussian(), rng.Gaussian()}; }

Sim3d RandomSim3d(Rng& rng) {
  return {rng.Uniform(0.1, 10), ExpSO3(RandomVector(rng)), 5 * RandomVector(rng)};
}

void ExpectEqual(const Sim3d& a, const Sim3d& b, double tolerance) {
  EXPECT_NEAR(a.scale / b.scale, 1, tolerance);
  EXPECT_LT(AngleBetween(a.rotation, b.rotation), tolerance);
  EXPECT_LT((a.translation - b.translation).norm(), tolerance * 100);
}

struct Problem {
  Sim3d truth;
  std::vector<Eigen::Vector3d> src, dst;
};

Problem MakeProblem(Rng& rng, int n, bool planar = false) {
  Problem problem{RandomSim3d(rng), {}, {}};
  for (int i = 0; i < n; ++i) {
    problem.src.push_back(RandomVector(rng));
    if (planar) problem.src.back().z() = 0;
    problem.dst.push_back(problem.truth * problem.src.back());
  }
  return problem;
}

TEST(AlignSimilarity, ExactOnExactPoints) {
  Rng rng(1);
  for (int trial = 0; trial < 1000; ++trial) {
    const Problem p = MakeProblem(rng, 4 + trial % 10, trial % 3 == 0);
    const std::optional<Sim3d> aligned = AlignSimilarity(p.src, p.dst);
    ASSERT_TRUE(aligned);
    ExpectEqual(*aligned, p.truth, 1e-9);
  }
}

TEST(AlignSimilarity, WeightsDecide) {
  Rng rng(3);
  Problem p = MakeProblem(rng, 10);
  p.dst[0] += Eigen::Vector3d(100, 0, 0);
  std::vector<double> weights(10, 1.0);
  weights[0] = 0;
  ExpectEqual(AlignSimilarity(p.src, p.dst, weights).value(), p.truth, 1e-9);
  EXPECT_GT((AlignSimilarity(p.src, p.dst)->translation - p.truth.translation).norm(), 1);
}

TEST(AlignSimilarity, DegenerateInput) {
  EXPECT_FALSE(AlignSimilarity({}, {}));
  const Eigen::Vector3d x(1, 2, 3);
  EXPECT_FALSE(AlignSimilarity({x}, {x}));
  EXPECT_FALSE(AlignSimilarity({x, x, x}, {x, 2 * x, 3 * x}));
  EXPECT_TRUE(AlignSimilarity({x, 2 * x, 3 * x}, {x, 2 * x, 3 * x}));
}

TEST(AlignSimilarityRobust, ExactDespiteOutliers) {
  Rng rng(4);
  for (const int n : {7, 30, 200}) {
    for (const double outliers : {0.0, 0.2, 0.4}) {
      Problem p = MakeProblem(rng, n);
      for (int i = 0; i < outliers * n; ++i) p.dst[i] += 100 * RandomVector(rng);
      const std::optional<Sim3d> aligned = AlignSimilarityRobust(p.src, p.dst);
      ASSERT_TRUE(aligned);
      ExpectEqual(*aligned, p.truth, 1e-8);
    }
  }
}

TEST(AlignSimilarityRobust, OneFarCameraDoesNotPull) {
  Rng rng(5);
  Problem p = MakeProblem(rng, 12);
  for (Eigen::Vector3d& x : p.dst) x += 0.01 * p.truth.scale * RandomVector(rng);
  p.dst[11] += 1000 * p.truth.scale * RandomVector(rng);
  const std::optional<Sim3d> aligned = AlignSimilarityRobust(p.src, p.dst);
  ASSERT_TRUE(aligned);
  for (int i = 0; i < 11; ++i) {
    EXPECT_LT((*aligned * p.src[i] - p.dst[i]).norm(), 0.06 * p.truth.scale);
  }
}

TEST(AlignSimilarityRobust, SameSeedSameResultAndDegenerateInput) {
  Rng rng(6);
  Problem p = MakeProblem(rng, 100);
  for (Eigen::Vector3d& x : p.dst) x += RandomVector(rng);
  const Sim3d a = AlignSimilarityRobust(p.src, p.dst, 7).value();
  const Sim3d b = AlignSimilarityRobust(p.src, p.dst, 7).value();
  EXPECT_EQ(a.translation, b.translation);
  EXPECT_FALSE(AlignSimilarityRobust({p.src[0], p.src[1]}, {p.dst[0], p.dst[1]}));
  const std::vector<Eigen::Vector3d> same(5, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(AlignSimilarityRobust(same, std::vector(p.dst.begin(), p.dst.begin() + 5)));
}

TEST(AlignRotations, ExactDespiteOutliers) {
  Rng rng(7);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Quaterniond truth = ExpSO3(RandomVector(rng));  // dst_world_from_src_world
    std::vector<Eigen::Quaterniond> src, dst;
    for (int i = 0; i < 15; ++i) {
      src.push_back(ExpSO3(2 * RandomVector(rng)));
      dst.push_back(src.back() * truth.conjugate());
      if (i < 6) dst.back() = ExpSO3(RandomVector(rng)) * dst.back();
    }
    EXPECT_LT(AngleBetween(AlignRotationsL1(src, dst).value(), truth), 1e-7);
  }
  EXPECT_FALSE(AlignRotationsL1({}, {}));
}

// No estimate is the median, so the iteration has to leave the one where it starts.
TEST(AlignRotations, FindsTheMedianBetweenTheEstimates) {
  const Eigen::Quaterniond identity = Eigen::Quaterniond::Identity();
  std::vector<Eigen::Quaterniond> src, dst;
  for (int i = 0; i < 3; ++i) {  // an equilateral triangle of small rotations around z's axis
    const double angle = DegToRad(120 * i);
    src.push_back(ExpSO3(1e-4 * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0)));
    dst.push_back(identity);
  }
  EXPECT_LT(AngleBetween(AlignRotationsL1(src, dst).value(), identity), 1e-9);
}

}  // namespace
}  // namespace cairn
