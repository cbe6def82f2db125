#include "cairn/rotation_averaging/rotation_averaging.h"

#include <cstring>
#include <set>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/synthetic/poses.h"
#include "cairn/synthetic/view_graph_problem.h"
#include "math/random_vectors.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "unit/rotation_averaging/rotation_test_util.h"

namespace cairn {
namespace {

struct Problem {
  std::vector<RotationEdge> edges;
  std::vector<char> is_outlier;
  Rotations truth;
};

// Random rotations of images 1 .. n; a ring with chords, or a random graph over a ring.
Problem MakeProblem(int n, int num_edges, double noise_deg, double outlier_ratio, uint64_t seed) {
  Rng rng(seed, "rotation problem");
  Problem p;
  for (int k = 0; k < n; ++k) p.truth[k + 1] = RandomRotation(rng);
  std::set<std::pair<image_t, image_t>> pairs;
  for (int k = 0; k < n && n > 2; ++k)
    pairs.insert({std::min(k + 1, (k + 1) % n + 1), std::max(k + 1, (k + 1) % n + 1)});
  while (static_cast<int>(pairs.size()) < num_edges) {
    const image_t a = 1 + rng.UniformInt(n), b = 1 + rng.UniformInt(n);
    if (a < b) pairs.insert({a, b});
  }
  for (const auto& [a, b] : pairs) {
    const Eigen::Vector3d noise = GaussianVector<3>(rng);
    Eigen::Quaterniond q = p.truth[b] * p.truth[a].conjugate();
    q = ExpSO3(DegToRad(noise_deg) * noise) * q;
    const bool is_outlier = rng.Uniform() < outlier_ratio;
    if (is_outlier) q = RandomRotation(rng);
    p.edges.push_back({a, b, q, 1.0 + rng.UniformInt(100)});
    p.is_outlier.push_back(is_outlier);
  }
  return p;
}

bool SameBytes(const Rotations& a, const Rotations& b) {
  if (a.size() != b.size()) return false;
  for (auto i = a.begin(), j = b.begin(); i != a.end(); ++i, ++j) {
    if (i->first != j->first) return false;
    if (std::memcmp(i->second.coeffs().data(), j->second.coeffs().data(), 32) != 0) return false;
  }
  return true;
}

TEST(RotationAveraging, ExactWithoutNoise) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Problem p = MakeProblem(30, 60 + 10 * static_cast<int>(seed), 0, 0, seed);
    const RotationAveragingReport report = AverageRotations(p.edges);
    ASSERT_EQ(report.status, RotationAveragingStatus::kSuccess);
    ASSERT_EQ(report.cam_from_world.size(), 30u);
    EXPECT_LT(Summarize(AlignedRotationErrorsDeg(report.cam_from_world, p.truth)).max, 1e-9);
    EXPECT_EQ(report.num_rejected, 0);
    EXPECT_LT(report.median_residual_deg, 1e-9);
  }
}

// A tree has nothing to average: every edge is fulfilled exactly, right or wrong.
TEST(RotationAveraging, SingleEdgeAndChain) {
  for (const int n : {2, 5}) {
    const Problem ring = MakeProblem(n, n - 1, 3.0, 0, 4);
    const std::vector<RotationEdge> edges(ring.edges.begin(), ring.edges.begin() + n - 1);
    const RotationAveragingReport report = AverageRotations(edges);
    ASSERT_EQ(report.status, RotationAveragingStatus::kSuccess);
    for (const RotationEdge& e : edges) {
      const Eigen::Quaterniond q =
          report.cam_from_world.at(e.image_id2) * report.cam_from_world.at(e.image_id1).conjugate();
      EXPECT_LT(AngleBetween(q, e.cam2_from_cam1), 1e-12);
    }
  }
}

TEST(RotationAveraging, RecoversTruthAndRejectsOutliers) {
  for (const double outlier_ratio : {0.0, 0.2, 0.4}) {
    for (uint64_t seed = 0; seed < 10; ++seed) {
      const Problem p = MakeProblem(60, 600, 0.5, outlier_ratio, seed);
      const RotationAveragingReport report = AverageRotations(p.edges);
      const auto summary = Summarize(AlignedRotationErrorsDeg(report.cam_from_world, p.truth));
      EXPECT_LT(summary.max, 1.5) << outlier_ratio << " seed " << seed;
      EXPECT_LT(summary.mean, 0.4) << outlier_ratio << " seed " << seed;
      int num_wrong = 0;
      for (size_t e = 0; e < p.edges.size(); ++e) {
        num_wrong += report.edge_rejected[e] != p.is_outlier[e];
      }
      EXPECT_LE(num_wrong, 2);  // a random rotation may be nearly right
    }
  }
}

// On a long ring the spanning tree's error grows along the way; averaging spreads it.
TEST(RotationAveraging, SpreadsDriftOverARing) {
  Problem p = MakeProblem(200, 200, 1.0, 0, 3);
  const RotationAveragingReport report = AverageRotations(p.edges);
  double largest = 0;
  for (const double residual : report.edge_residuals_deg) largest = std::max(largest, residual);
  EXPECT_EQ(report.status, RotationAveragingStatus::kSuccess);
  EXPECT_LT(largest, 2.0);  // the tree leaves about 1 deg * sqrt(3 * 200) = 24 deg on one edge
}

TEST(RotationAveraging, LandmarkGraphWithRealisticErrors) {
  ViewGraphOptions options;
  options.num_images = 150;
  options.num_edges = 4000;
  options.heavy_tail = 1.0;
  options.outlier_ratio = 0.2;
  const ViewGraphProblem problem = MakeViewGraphProblem(options, 5);
  std::vector<RotationEdge> edges;
  Rotations truth;
  for (const ViewEdge& e : problem.graph.edges) {
    edges.push_back({e.image_id1, e.image_id2, e.cam2_from_cam1.rotation,
                     static_cast<double>(std::max(1, e.num_inliers))});
  }
  for (const auto& [id, pose] : problem.cam_from_world) truth[id] = pose.rotation;
  const auto summary =
      Summarize(AlignedRotationErrorsDeg(AverageRotations(edges).cam_from_world, truth));
  EXPECT_LT(summary.median, 1.0);
  EXPECT_GT(summary.FractionBelow(5.0), 0.97);
}

// A city: places on a grid, each with many images. Of every two places that are half of the city
// apart, pairs say, consistently, that they are one. They are fewer than those to all neighbors
// together, but more than those to any one.
struct LookAlikes {
  int width = 3;  // of the city, in places; it is twice as long
  int images_per_place = 20;
  double part = 1;   // share of a place's images that see what looks alike
  double share = 1;  // of the pairs of such images that were found
  double own_weight = 50;
};

Problem MakeLookAlikePlaces(const LookAlikes& options, uint64_t seed) {
  Rng rng(seed, "look-alike places");
  const int width = options.width, num_places = 2 * width * width;
  Problem p;
  std::vector<char> sees_part;
  std::vector<Eigen::Quaterniond> cam_from_place, place_from_world;
  for (int k = 0; k < num_places; ++k) place_from_world.push_back(RandomRotation(rng));
  for (int i = 0; i < num_places * options.images_per_place; ++i) {
    sees_part.push_back(rng.Uniform() < options.part);
    cam_from_place.push_back(RandomRotation(rng));
    p.truth[i + 1] = cam_from_place[i] * place_from_world[i % num_places];
  }
  const auto add = [&](int i, int j, double share, double weight, bool is_outlier) {
    if (rng.Uniform() > share) return;
    const Eigen::Vector3d noise = GaussianVector<3>(rng);
    const Eigen::Quaterniond q = is_outlier ? cam_from_place[j] * cam_from_place[i].conjugate()
                                            : p.truth[j + 1] * p.truth[i + 1].conjugate();
    p.edges.push_back({static_cast<image_t>(i + 1), static_cast<image_t>(j + 1),
                       ExpSO3(DegToRad(1.0) * noise) * q, weight});
    p.is_outlier.push_back(is_outlier);
  };
  for (size_t i = 0; i < cam_from_place.size(); ++i) {
    for (size_t j = i + 1; j < cam_from_place.size(); ++j) {
      const int a = static_cast<int>(i) % num_places, b = static_cast<int>(j) % num_places;
      const bool are_neighbors =
          std::abs(a % width - b % width) <= 1 && std::abs(a / width - b / width) <= 1;
      const int from = static_cast<int>(i), to = static_cast<int>(j);
      if (a == b) {
        add(from, to, 0.6, options.own_weight, false);
      } else if (are_neighbors) {
        add(from, to, 0.2, 40, false);
      } else if (std::abs(a - b) == num_places / 2 && sees_part[i] && sees_part[j]) {
        add(from, to, options.share, 50, true);
      }
    }
  }
  return p;
}

TEST(RotationAveraging, PlacesThatLookAlikeAreNotPutOnTopOfEachOther) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Problem p = MakeLookAlikePlaces({.share = 0.4, .own_weight = 200}, seed);
    for (const double power : {0.0, 1.0}) {
      RotationAveragingOptions options;
      options.weight_power = power;
      const RotationAveragingReport report = AverageRotations(p.edges, options);
      EXPECT_LT(Summarize(AlignedRotationErrorsDeg(report.cam_from_world, p.truth)).max, 3)
          << "seed " << seed << ", weight_power " << power;
    }
  }
}

// Here the images of two places that see what looks alike hang together more than either place's
// own do, so that no clustering of images finds the places.
TEST(RotationAveraging, RegionsThatAreFoldedOntoOthersAreTurnedBack) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Problem p = MakeLookAlikePlaces({.width = 5, .part = 0.6}, seed);
    const auto share_right = [&p](const RotationAveragingOptions& options) {
      const auto found = AverageRotations(p.edges, options).cam_from_world;
      return Summarize(AlignedRotationErrorsDeg(found, p.truth)).FractionBelow(3);
    };
    EXPECT_GT(share_right({}), 0.99) << seed;
    EXPECT_LT(share_right({.max_region_rounds = 0}), 0.9) << seed;
  }
}

TEST(RotationAveraging, SameBytesForAnyOrderDirectionAndThreads) {
  const Problem p = MakeProblem(80, 1500, 1.0, 0.3, 11);
  const RotationAveragingReport reference = AverageRotations(p.edges);
  ASSERT_EQ(reference.cam_from_world.size(), 80u);
  std::vector<RotationEdge> edges = p.edges;
  Rng rng(1);
  for (RotationEdge& e : edges) {
    if (rng.Uniform() < 0.5) continue;
    std::swap(e.image_id1, e.image_id2);
    e.cam2_from_cam1 = e.cam2_from_cam1.conjugate();
    e.cam2_from_cam1.coeffs() *= -1;
  }
  rng.Shuffle(edges);
  for (const int num_threads : {1, 2, 8}) {
    EXPECT_TRUE(SameBytes(AverageRotations(edges, {}, {.num_threads = num_threads}).cam_from_world,
                          reference.cam_from_world));
  }
}

// Large enough for threads to look ahead, with cameras that jump.
TEST(RotationAveraging, SameBytesForAnyNumberOfThreadsOnALargeGraph) {
  const Problem p = MakeProblem(330, 52000, 1.0, 0.7, 12);
  RotationAveragingOptions options;
  options.max_l1_iterations = 0;
  const auto average = [&](int num_threads) {
    return AverageRotations(p.edges, options, {.num_threads = num_threads});
  };
  const RotationAveragingReport reference = average(1);
  for (const int num_threads : {2, 3}) {
    EXPECT_TRUE(SameBytes(average(num_threads).cam_from_world, reference.cam_from_world));
  }
}

TEST(RotationAveraging, GoesOnFromOtherRotations) {
  const Problem p = MakeProblem(60, 900, 1.0, 0.2, 13);
  RotationAverager averager(p.edges);
  const RotationAveragingReport first = averager.Average();
  EXPECT_TRUE(SameBytes(first.cam_from_world, AverageRotations(p.edges).cam_from_world));
  Rotations start = first.cam_from_world;
  for (const image_t id : {7, 8, 9})
    start.at(id) = ExpSO3(Eigen::Vector3d(0, 1.5, 0)) * start.at(id);
  RotationAveragingOptions options;
  options.weight_power = 1;
  const RotationAveragingReport second = averager.AverageFrom(start, options);
  EXPECT_EQ(second.status, RotationAveragingStatus::kSuccess);
  EXPECT_EQ(second.num_l1_iterations, 0);
  const Rotations fresh = AverageRotations(p.edges, options).cam_from_world;
  EXPECT_LT(Summarize(AlignedRotationErrorsDeg(second.cam_from_world, fresh)).max, 0.01);
  EXPECT_GT(Summarize(AlignedRotationErrorsDeg(first.cam_from_world, fresh)).max, 0.01);
}

TEST(RotationAveraging, RelabelingImagesChangesNothingButTheGauge) {
  const Problem p = MakeProblem(40, 300, 1.0, 0.2, 12);
  const RotationAveragingReport reference = AverageRotations(p.edges);
  std::vector<RotationEdge> edges = p.edges;
  const auto relabel = [](image_t id) { return 1000 - 7 * id; };
  for (RotationEdge& e : edges) {
    e.image_id1 = relabel(e.image_id1);
    e.image_id2 = relabel(e.image_id2);
  }
  Rotations relabeled;
  for (const auto& [id, q] : reference.cam_from_world) relabeled[relabel(id)] = q;
  const auto errors = AlignedRotationErrorsDeg(AverageRotations(edges).cam_from_world, relabeled);
  EXPECT_LT(Summarize(errors).max, 0.01);
}

TEST(RotationAveraging, ReportsResidualsInTheOrderOfTheInput) {
  const Problem p = MakeProblem(20, 100, 2.0, 0.1, 13);
  const RotationAveragingReport report = AverageRotations(p.edges);
  ASSERT_EQ(report.edge_residuals_deg.size(), p.edges.size());
  for (size_t k = 0; k < p.edges.size(); ++k) {
    const RotationEdge& e = p.edges[k];
    const Eigen::Quaterniond q =
        report.cam_from_world.at(e.image_id2) * report.cam_from_world.at(e.image_id1).conjugate();
    EXPECT_NEAR(report.edge_residuals_deg[k], RadToDeg(AngleBetween(q, e.cam2_from_cam1)), 1e-9);
  }
}

TEST(RotationAveraging, EmptyGraph) {
  const RotationAveragingReport report = AverageRotations({});
  EXPECT_EQ(report.status, RotationAveragingStatus::kNoEdges);
  EXPECT_TRUE(report.cam_from_world.empty());
}

TEST(RotationAveraging, EachComponentIsSolvedInItsOwnGauge) {
  const Problem a = MakeProblem(10, 30, 0, 0, 1);
  Problem b = MakeProblem(6, 12, 0, 0, 2);
  std::vector<RotationEdge> edges = a.edges;
  Rotations truth_b;
  for (RotationEdge& e : b.edges) {
    e.image_id1 += 100;
    e.image_id2 += 100;
    edges.push_back(e);
  }
  for (const auto& [id, q] : b.truth) truth_b[id + 100] = q;
  const RotationAveragingReport report = AverageRotations(edges);
  EXPECT_THAT(report.components, ElementsAre(ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 10),
                                             ElementsAre(101, 102, 103, 104, 105, 106)));
  EXPECT_LT(Summarize(AlignedRotationErrorsDeg(report.cam_from_world, a.truth)).max, 1e-9);
  EXPECT_LT(Summarize(AlignedRotationErrorsDeg(report.cam_from_world, truth_b)).max, 1e-9);
}

TEST(RotationAveraging, ContradictingParallelEdges) {
  Problem p = MakeProblem(10, 40, 0, 0, 6);
  RotationEdge wrong = p.edges[5];
  wrong.cam2_from_cam1 = ExpSO3({0, 0, 2}) * wrong.cam2_from_cam1;
  wrong.weight = 1e6;
  p.edges.insert(p.edges.begin(), wrong);
  const RotationAveragingReport report = AverageRotations(p.edges);
  EXPECT_LT(Summarize(AlignedRotationErrorsDeg(report.cam_from_world, p.truth)).max, 0.05);
  EXPECT_TRUE(report.edge_rejected[0]);
  EXPECT_EQ(report.num_rejected, 1);
}

TEST(AverageRotations, WeightsThatDifferByManyPowersOfTenAreNoBug) {
  RotationAveragingOptions options;
  options.weight_power = 1;
  const auto edge = [](image_t id1, image_t id2, double weight) {
    return RotationEdge{id1, id2, ExpSO3({0, 0.1, 0}), weight};
  };
  const std::vector<RotationEdge> edges = {edge(1, 2, 1e-6), edge(2, 3, 1e12), edge(1, 4, 1),
                                           edge(1, 5, 1)};
  const RotationAveragingReport report = AverageRotations(edges, options);
  EXPECT_EQ(report.status, RotationAveragingStatus::kSuccess);
  EXPECT_EQ(report.cam_from_world.size(), 5u);
}

// Two measurements of one rotation, in the reweighted stage alone: their weighted mean.
TEST(RotationAveraging, ASurerEdgePullsMore) {
  RotationAveragingOptions options;
  options.max_l1_iterations = options.max_consensus_rounds = 0;
  options.sigma_start_deg = options.sigma_end_deg = 100;  // both are good
  const auto found_deg = [&](double weight_power) {
    options.weight_power = weight_power;
    const auto edge = [](double angle_deg, double weight) {
      return RotationEdge{
          1, 2,
          Eigen::Quaterniond(Eigen::AngleAxisd(DegToRad(angle_deg), Eigen::Vector3d::UnitY())),
          weight};
    };
    const auto report = AverageRotations(std::vector{edge(0, 9), edge(4, 1)}, options);
    return RadToDeg(AngleBetween(report.cam_from_world.at(1), report.cam_from_world.at(2)));
  };
  EXPECT_NEAR(found_deg(1), 0.4, 0.02);
  EXPECT_NEAR(found_deg(0), 2.0, 0.02);
}

TEST(RotationAveraging, EveryOptionChangesTheResult) {
  const Problem p = MakeProblem(40, 250, 2.0, 0.4, 14);
  const RotationAveragingReport reference = AverageRotations(p.edges);
  const auto differs = [&](auto change) {
    RotationAveragingOptions options;
    change(options);
    const RotationAveragingReport report = AverageRotations(p.edges, options);
    return !SameBytes(report.cam_from_world, reference.cam_from_world);
  };
  using O = RotationAveragingOptions;
  EXPECT_FALSE(differs([](O& o) {}));
  EXPECT_TRUE(differs([](O& o) { o.max_l1_iterations = 0; }));
  EXPECT_TRUE(differs([](O& o) { o.max_consensus_rounds = 0; }));
  EXPECT_TRUE(differs([](O& o) { o.max_irls_iterations = 3; }));
  EXPECT_TRUE(differs([](O& o) { o.sigma_start_deg = 8; }));
  EXPECT_TRUE(differs([](O& o) { o.sigma_end_deg = 3; }));
  EXPECT_TRUE(differs([](O& o) { o.sigma_decay = 0.5; }));
  EXPECT_TRUE(differs([](O& o) { o.convergence_deg = 1; }));
  EXPECT_TRUE(differs([](O& o) { o.weight_power = 1; }));
  RotationAveragingOptions strict;
  strict.max_error_deg = 0.1;
  EXPECT_GT(AverageRotations(p.edges, strict).num_rejected, reference.num_rejected);
}

TEST(RotationAveraging, SaysWhenIterationsDidNotSuffice) {
  RotationAveragingOptions options;
  options.max_irls_iterations = 2;
  EXPECT_EQ(AverageRotations(MakeProblem(20, 80, 2, 0, 1).edges, options).status,
            RotationAveragingStatus::kNotConverged);
}

TEST(RotationAveraging, StopsWhenAsked) {
  TestMonitor stopper(0);
  const RotationAveragingReport report =
      AverageRotations(MakeProblem(20, 80, 2, 0, 1).edges, {}, {.monitor = stopper});
  EXPECT_EQ(report.status, RotationAveragingStatus::kInterrupted);
  EXPECT_TRUE(report.cam_from_world.empty());
}

TEST(RotationAveraging, RefusesMeaninglessInput) {
  const Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  const auto run = [](const RotationEdge& edge) { AverageRotations(std::vector{edge}); };
  EXPECT_THROW(run({1, 1, q, 1.0}), BugError);
  EXPECT_THROW(run({1, 2, q, 0.0}), BugError);
  EXPECT_THROW(run({1, 2, Eigen::Quaterniond(0, 0, 0, 0), 1.0}), BugError);
  RotationAveragingOptions options;
  options.sigma_decay = 2;
  EXPECT_THROW(AverageRotations({}, options), ConfigError);
}

}  // namespace
}  // namespace cairn
