#include "cairn/translation_averaging/translation_averaging.h"

#include <cmath>
#include <numbers>

#include "cairn/base/error.h"
#include "math/random_vectors.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "unit/translation_averaging/direction_test_util.h"

namespace cairn {
namespace {

std::vector<Eigen::Vector3d> Ring(int n) {
  std::vector<Eigen::Vector3d> centers;
  for (int k = 0; k < n; ++k) {
    const double angle = 2 * std::numbers::pi * k / n;
    centers.push_back({std::cos(angle), std::sin(angle), 0.1 * std::sin(5 * angle)});
  }
  return centers;
}

std::vector<Eigen::Vector3d> Grid(int rows, int columns) {
  std::vector<Eigen::Vector3d> centers;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      centers.push_back({0.3 * c, 0.3 * r, 0.05 * std::sin(c + 2.0 * r)});
    }
  }
  return centers;
}

std::vector<Eigen::Vector3d> Line(int n, uint64_t seed) {
  Rng rng(seed);
  std::vector<Eigen::Vector3d> centers;
  double x = 0;
  for (int k = 0; k < n; ++k) centers.push_back({x += rng.Uniform(0.3, 1.7), 0, 0});
  return centers;
}

bool SameBytes(const Centers& a, const Centers& b) { return a == b; }

// Cameras 1 .. n along a road, each joined to the next three, with directions that err by a degree:
// the scale drifts.
DirectionScene Road(int n) {
  Rng rng(7);
  std::vector<Eigen::Vector3d> centers;
  for (int k = 0; k < n; ++k) centers.push_back({0.3 * k, 0.1 * std::sin(2.0 * k), 0.05 * (k % 3)});
  DirectionScene scene;
  scene.AddCenters(centers);
  scene.AddChain(3, 1.0, 0, rng);
  scene.AddPoints(10 * n, 4, 0.5, 1.0, 0, rng);
  return scene;
}

// Of the truth, with this standard deviation along two axes and nothing known of the third, moved
// to the frame of `centers`.
std::vector<CenterPrior> NoisyPriors(const Centers& truth, double sigma, const Centers& centers) {
  const auto [estimated, true_centers] = Paired(centers, truth);
  const Sim3d moved = AlignSimilarity(true_centers, estimated).value();
  const Eigen::Matrix3d to_truth =
      moved.rotation.conjugate().toRotationMatrix() / (moved.scale * sigma);
  const Eigen::Matrix3d known = Eigen::Vector3d(1, 1, 0).asDiagonal();
  Rng rng(3);
  std::vector<CenterPrior> priors;
  for (const auto& [id, center] : truth) {
    const Eigen::Vector2d error = sigma * GaussianVector<2>(rng);
    const Eigen::Vector3d measured = center + Eigen::Vector3d(error.x(), error.y(), 1000);
    priors.push_back({id, moved * measured, to_truth.transpose() * known * to_truth});
  }
  return priors;
}

TEST(TranslationAveraging, ExactWithoutNoise) {
  for (const bool with_points : {false, true}) {
    for (const auto& centers : {Ring(12), Grid(4, 5), Ring(100)}) {
      Rng rng(1);
      DirectionScene scene;
      scene.AddCenters(centers);
      scene.AddChain(5, 0, 0, rng);
      if (with_points) scene.AddPoints(100, 4, 1.0, 0, 0, rng);
      const auto report = AverageTranslations(scene.edges, scene.tracks);
      ASSERT_EQ(report.status, TranslationAveragingStatus::kSuccess);
      ASSERT_EQ(report.centers.size(), centers.size());
      EXPECT_LT(MaxError(RelativeCenterErrors(report.centers, scene.truth)), 1e-4)
          << centers.size() << " points: " << with_points;
    }
  }
}

// Directions between collinear cameras do not tell their distances; rays to points do.
TEST(TranslationAveraging, PointsPlaceCollinearCameras) {
  Rng rng(2);
  DirectionScene scene;
  scene.AddCenters(Line(30, 5));
  scene.AddChain(3, 0, 0, rng);
  scene.AddPoints(400, 5, 2.0, 0, 0, rng);
  const auto report = AverageTranslations(scene.edges, scene.tracks);
  ASSERT_EQ(report.centers.size(), 30u);
  EXPECT_LT(MaxError(RelativeCenterErrors(report.centers, scene.truth)), 1e-3);
}

// Wrong directions along a line draw its cameras together; lengths of baselines keep them apart.
TEST(TranslationAveraging, LengthsHoldCollinearCamerasAgainstWrongDirections) {
  Rng rng(2);
  DirectionScene scene;
  scene.AddCenters(Line(30, 5));
  scene.AddChain(4, 0.3, 0, rng);
  scene.AddPoints(200, 5, 2.0, 0.1, 0, rng);
  for (image_t id = 8; id < 20; ++id) {
    for (const image_t far : {8, 9, 10}) {
      scene.edges.push_back({id, id + far, Eigen::Vector3d(-1, 0.01 * far, 0)});
    }
  }
  const auto error = [&] {
    const auto report = AverageTranslations(scene.edges, scene.tracks);
    EXPECT_EQ(report.centers.size(), 30u);
    return MaxError(RelativeCenterErrors(report.centers, scene.truth));
  };
  EXPECT_GT(error(), 0.2);
  for (DirectionEdge& edge : scene.edges) {
    const bool is_right = edge.image_id2 <= edge.image_id1 + 4;
    const double length = (scene.truth[edge.image_id2] - scene.truth[edge.image_id1]).norm();
    edge.length = is_right ? 0.37 * length * (1 + 0.01 * rng.Gaussian()) : rng.Uniform(0.3, 3);
    edge.num_points = is_right ? 500 : 30;
  }
  EXPECT_LT(error(), 0.03);
}

TEST(TranslationAveraging, PriorsOfCentersHoldALongRoad) {
  const DirectionScene scene = Road(100);
  const double sigma = 0.5;
  const auto free = AverageTranslations(scene.edges, scene.tracks);
  const auto held =
      AverageTranslations(scene.edges, scene.tracks, {}, {}, [&](const Centers& centers) {
        EXPECT_EQ(centers, free.centers);
        return NoisyPriors(scene.truth, sigma, centers);
      });
  ASSERT_EQ(held.status, TranslationAveragingStatus::kSuccess);
  const double error = MaxError(RelativeCenterErrors(held.centers, scene.truth));
  EXPECT_LT(error, 0.5 * MaxError(RelativeCenterErrors(free.centers, scene.truth)));
  EXPECT_LT(error, sigma / 7.5);  // smaller than a prior's own error; 7.5 is the road's extent
}

// Images without directions have no position; a prior gives them none.
TEST(TranslationAveraging, PriorsOfOtherImagesOrNoneChangeNothing) {
  const DirectionScene scene = Road(20);
  const auto free = AverageTranslations(scene.edges, scene.tracks);
  const auto other = AverageTranslations(
      scene.edges, scene.tracks, {}, {}, [](const Centers&) -> std::vector<CenterPrior> {
        return {{77, Eigen::Vector3d::Ones(), Eigen::Matrix3d::Identity()}};
      });
  const auto none = AverageTranslations(scene.edges, scene.tracks, {}, {},
                                        [](const Centers&) { return std::vector<CenterPrior>(); });
  EXPECT_EQ(none.centers, free.centers);
  EXPECT_EQ(other.centers, free.centers);
}

TEST(TranslationAveraging, PointsAloneWithoutAnyEdge) {
  Rng rng(3);
  DirectionScene scene;
  scene.AddCenters(Ring(10));
  scene.AddPoints(200, 4, 1.0, 0, 0, rng);
  const auto report = AverageTranslations({}, scene.tracks);
  ASSERT_EQ(report.status, TranslationAveragingStatus::kSuccess);
  ASSERT_EQ(report.centers.size(), 10u);
  EXPECT_LT(MaxError(RelativeCenterErrors(report.centers, scene.truth)), 1e-3);
}

TEST(TranslationAveraging, NoiseAndOutliers) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    Rng rng(seed, "noise");
    DirectionScene scene;
    scene.AddCenters(Ring(40));
    for (image_t a = 1; a <= 40; ++a) {
      for (image_t b = a + 1; b <= 40; ++b) {
        if (rng.Uniform() < 0.4) scene.AddEdge(a, b, 1.0, 0.2, rng);
      }
    }
    scene.AddPoints(600, 5, 1.0, 0.2, 0.1, rng);
    const auto report = AverageTranslations(scene.edges, scene.tracks);
    ASSERT_EQ(report.status, TranslationAveragingStatus::kSuccess);
    ASSERT_EQ(report.centers.size(), 40u);
    EXPECT_LT(MaxError(RelativeCenterErrors(report.centers, scene.truth)), 0.05) << "seed " << seed;
    EXPECT_GT(report.num_filtered, 20);
  }
}

// Steps of points that wrong rays mislead do not hold back all others.
TEST(TranslationAveraging, FewIterationsWithWrongRaysAlongARoad) {
  Rng rng(2);
  DirectionScene scene;
  scene.AddCenters(Line(200, 3));
  scene.AddChain(3, 0.3, 0, rng);
  scene.AddPoints(1000, 10, 10.0, 0.05, 0, rng);
  for (PointDirections& track : scene.tracks) {
    const Eigen::Vector3d& X = scene.true_points[rng.UniformInt(1000)];
    for (PointRay& ray : track.rays) {
      if (rng.Uniform() < 0.1) ray.direction = X - scene.truth[ray.image_id];
    }
  }
  const auto report = AverageTranslations(scene.edges, scene.tracks);
  ASSERT_EQ(report.centers.size(), 200u);
  EXPECT_LT(MaxError(RelativeCenterErrors(report.centers, scene.truth)), 0.01);
  EXPECT_LE(report.num_iterations, 30);
}

TEST(TranslationAveraging, FewPhotos) {
  for (const int n : {3, 5, 8}) {
    Rng rng(n);
    DirectionScene scene;
    std::vector<Eigen::Vector3d> centers = Ring(4 * n);
    centers.resize(n);
    scene.AddCenters(centers);
    scene.AddChain(n, 0.5, 0, rng);
    scene.AddPoints(300, n, 1.0, 0.05, 0.05, rng);
    const auto report = AverageTranslations(scene.edges, scene.tracks);
    ASSERT_EQ(report.centers.size(), static_cast<size_t>(n));
    EXPECT_LT(MaxError(RelativeCenterErrors(report.centers, scene.truth)), 0.03) << n;
  }
}

TEST(TranslationAveraging, TwoImages) {
  const std::vector<DirectionEdge> edges = {{7, 3, {0, 2, 0}}};
  const auto report = AverageTranslations(edges, {});
  ASSERT_EQ(report.status, TranslationAveragingStatus::kSuccess);
  const Eigen::Vector3d d = (report.centers.at(3) - report.centers.at(7)).normalized();
  EXPECT_LT((d - Eigen::Vector3d(0, 1, 0)).norm(), 1e-9);
}

TEST(TranslationAveraging, NothingToAverage) {
  EXPECT_EQ(AverageTranslations({}, {}).status, TranslationAveragingStatus::kNoEdges);
  PointDirections single;
  single.rays = {{1, {0, 0, 1}}};
  const auto report = AverageTranslations({}, std::vector{single});
  EXPECT_EQ(report.status, TranslationAveragingStatus::kNoEdges);
}

TEST(TranslationAveraging, NamesWhatCannotBePlaced) {
  Rng rng(5);
  DirectionScene scene;
  scene.AddCenters(Ring(12));
  for (image_t a = 1; a <= 10; ++a) {
    for (image_t b = a + 1; b <= 10; ++b) scene.AddEdge(a, b, 0.2, 0, rng);
  }
  scene.AddEdge(10, 11, 0.2, 0, rng);
  scene.AddEdge(11, 12, 0.2, 0, rng);
  const auto report = AverageTranslations(scene.edges, {});
  EXPECT_EQ(report.centers.size(), 10u);
  EXPECT_THAT(report.not_rigid, ElementsAre(11, 12));
}

TEST(TranslationAveraging, RefusesDirectionsWithoutASolution) {
  Rng rng(6);
  DirectionScene scene;
  scene.AddCenters(Ring(20));
  scene.AddChain(20, 0, 1.0, rng);
  TranslationAveragingOptions options;
  options.filter_max_inconsistency = 1;
  const auto report = AverageTranslations(scene.edges, {}, options);
  EXPECT_EQ(report.status, TranslationAveragingStatus::kInconsistent);
  EXPECT_THAT(report.centers, IsEmpty());
  EXPECT_FALSE(report.message.empty());
}

// Nine photographs by a tripod have no directions between them, and leave the seven others in.
TEST(TranslationAveraging, ManyCamerasInOnePlaceAreNoReasonToLeaveOthersOut) {
  DirectionScene scene;
  std::vector<Eigen::Vector3d> centers = Ring(8);
  for (int k = 0; k < 8; ++k) centers.push_back(centers[0]);
  scene.AddCenters(centers);
  for (const auto& [id1, center1] : scene.truth) {
    for (const auto& [id2, center2] : scene.truth) {
      if (id1 < id2 && center1 != center2) {
        scene.edges.push_back({id1, id2, (center2 - center1).normalized()});
      }
    }
  }
  const auto report = AverageTranslations(scene.edges, {});
  EXPECT_EQ(report.status, TranslationAveragingStatus::kSuccess) << report.message;
  ASSERT_EQ(report.centers.size(), 16u);
  EXPECT_LT((report.centers.at(1) - report.centers.at(16)).norm(), 1e-4);
}

TEST(TranslationAveraging, LeavesOutWhatIsThrownFarAway) {
  Rng rng(7);
  DirectionScene scene;
  std::vector<Eigen::Vector3d> centers = Ring(10);
  for (Eigen::Vector3d& c : centers) c *= 1e-6;
  centers.push_back({1, 0, 0});
  centers.push_back({0, 1, 0.5});
  centers.push_back({0, -1, 0.2});
  scene.AddCenters(centers);
  scene.AddChain(13, 0, 0, rng);
  const auto report = AverageTranslations(scene.edges, {});
  EXPECT_EQ(report.status, TranslationAveragingStatus::kSuccess) << report.message;
  EXPECT_EQ(report.centers.size(), 10u);
}

TEST(TranslationAveraging, SameBytesForAnyOrderDirectionAndThreads) {
  Rng rng(8);
  DirectionScene scene;
  scene.AddCenters(Ring(30));
  scene.AddChain(8, 1.0, 0.1, rng);
  scene.AddPoints(300, 5, 1.0, 0.2, 0.1, rng);
  const auto reference = AverageTranslations(scene.edges, scene.tracks);
  ASSERT_EQ(reference.centers.size(), 30u);
  for (DirectionEdge& e : scene.edges) {
    if (rng.Uniform() < 0.5) continue;
    std::swap(e.image_id1, e.image_id2);
    e.direction = -e.direction;
  }
  rng.Shuffle(scene.edges);
  for (PointDirections& track : scene.tracks) rng.Shuffle(track.rays);
  rng.Shuffle(scene.tracks);
  for (const int num_threads : {1, 2, 8}) {
    const auto report =
        AverageTranslations(scene.edges, scene.tracks, {}, {.num_threads = num_threads});
    EXPECT_TRUE(SameBytes(report.centers, reference.centers));
  }
}

TEST(TranslationAveraging, RelabelingImagesChangesNothingButTheGauge) {
  Rng rng(9);
  DirectionScene scene;
  scene.AddCenters(Ring(30));
  scene.AddChain(8, 0.5, 0.0, rng);
  const auto reference = AverageTranslations(scene.edges, {});
  Centers relabeled;
  for (const auto& [id, c] : reference.centers) relabeled[100 - id] = c;
  for (DirectionEdge& e : scene.edges) {
    e.image_id1 = 100 - e.image_id1;
    e.image_id2 = 100 - e.image_id2;
  }
  const auto report = AverageTranslations(scene.edges, {});
  EXPECT_LT(MaxError(RelativeCenterErrors(report.centers, relabeled)), 1e-3);
}

TEST(TranslationAveraging, EveryOptionChangesTheResult) {
  Rng rng(11);
  DirectionScene scene;
  scene.AddCenters(Ring(20));
  scene.AddChain(6, 2.0, 0.15, rng);
  scene.AddPoints(100, 4, 1.0, 0.5, 0.1, rng);
  const auto reference = AverageTranslations(scene.edges, scene.tracks);
  ASSERT_EQ(reference.status, TranslationAveragingStatus::kSuccess);
  const auto run = [&](auto change) {
    TranslationAveragingOptions options;
    change(options);
    return AverageTranslations(scene.edges, scene.tracks, options);
  };
  const auto differs = [&](auto change) {
    return !SameBytes(run(change).centers, reference.centers);
  };
  using O = TranslationAveragingOptions;
  EXPECT_FALSE(differs([](O& o) {}));
  EXPECT_TRUE(differs([](O& o) { o.filter_num_axes = 2; }));
  EXPECT_TRUE(differs([](O& o) { o.filter_max_inconsistency = 0.01; }));
  EXPECT_TRUE(differs([](O& o) { o.huber_deg = 0.2; }));
  EXPECT_TRUE(differs([](O& o) { o.point_weight = 7; }));
  EXPECT_TRUE(differs([](O& o) { o.num_reweightings = 0; }));
  EXPECT_TRUE(differs([](O& o) { o.max_iterations = 1; }));
  EXPECT_EQ(run([](O& o) { o.max_median_error_deg = 0.01; }).status,
            TranslationAveragingStatus::kInconsistent);
}

TEST(TranslationAveraging, StopsWhenAsked) {
  TestMonitor stopper(0);
  Rng rng(12);
  DirectionScene scene;
  scene.AddCenters(Ring(10));
  scene.AddChain(5, 1, 0, rng);
  const auto report = AverageTranslations(scene.edges, {}, {}, {.monitor = stopper});
  EXPECT_EQ(report.status, TranslationAveragingStatus::kInterrupted);
  EXPECT_THAT(report.centers, IsEmpty());
}

TEST(TranslationAveraging, RefusesMeaninglessInput) {
  const auto run = [](const DirectionEdge& edge) { AverageTranslations(std::vector{edge}, {}); };
  EXPECT_THROW(run({1, 1, {0, 0, 1}}), BugError);
  EXPECT_THROW(run({1, 2, {0, 0, 0}}), BugError);
  PointDirections twice;
  twice.rays = {{1, {0, 0, 1}}, {1, {0, 1, 0}}};
  EXPECT_THROW(AverageTranslations({}, std::vector{twice}), BugError);
  TranslationAveragingOptions options;
  options.huber_deg = -1;
  EXPECT_THROW(AverageTranslations({}, {}, options), ConfigError);
}

}  // namespace
}  // namespace cairn
