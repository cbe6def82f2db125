#include <algorithm>
#include <numeric>

#include "cairn/geometry/epipolar.h"
#include "cairn/math/angles.h"
#include "math/random_vectors.h"
#include "robust/match_errors.h"
#include "support/random_two_view.h"
#include "support/test.h"
#include "two_view/decide/evidence.h"
#include "two_view/pair_fixture.h"
#include "two_view/prepare/local_consensus.h"
#include "two_view/search/fundamental_search.h"
#include "two_view/search/guided_support.h"
#include "two_view/search/pose_resampling.h"
#include "two_view/search/pose_search.h"
#include "two_view/search/search_steps.h"

namespace cairn::internal {
namespace {

// Matches of one smooth surface: a plane seen by two cameras, with the plane's affine frames, and
// wrong matches after them.
Pair MakeSmoothPair(int num_right, int num_wrong, uint64_t seed) {
  const Rigid3d motion(ExpSO3(Eigen::Vector3d(0.05, -0.15, 0.4)), Eigen::Vector3d(0.9, 0.2, -0.3));
  Pair pair = MakePlanarPair(motion, false, num_right + num_wrong, 0.3, seed);
  const Eigen::Vector3d normal = Eigen::Vector3d(0.2, -0.3, 1.0).normalized();
  const Eigen::Matrix3d H =
      pair.camera2.CalibrationMatrix() *
      (motion.RotationMatrix() + motion.translation * normal.transpose() / 4.0) *
      pair.camera1.CalibrationMatrix().inverse();
  for (size_t i = 0; i < pair.keypoints1.size(); ++i) {
    Keypoint& k2 = pair.keypoints2[i];
    const Eigen::Vector2d x = pair.keypoints1[i].Position();
    const Eigen::Vector3d y = H * x.homogeneous();
    Eigen::Matrix2d A;
    for (int r = 0; r < 2; ++r) {
      for (int c = 0; c < 2; ++c) A(r, c) = (H(r, c) - y[r] / y.z() * H(2, c)) / y.z();
    }
    const Eigen::Matrix2d shape = A * pair.keypoints1[i].Shape();
    k2.a11 = static_cast<float>(shape(0, 0)), k2.a12 = static_cast<float>(shape(0, 1));
    k2.a21 = static_cast<float>(shape(1, 0)), k2.a22 = static_cast<float>(shape(1, 1));
  }
  for (int i = 0; i < num_wrong; ++i) {
    pair.matches[num_right + i].point2 =
        static_cast<point2D_t>(num_right + (i + num_wrong / 2) % num_wrong);
    pair.is_inlier[num_right + i] = false;
  }
  return pair;
}

TEST(LocalConsensus, TellsRightMatchesFromWrongOnes) {
  const Pair pair = MakeSmoothPair(100, 300, 1);
  std::vector<int32_t> indices(pair.matches.size());
  std::iota(indices.begin(), indices.end(), 0);
  const LocalConsensus consensus = CountVotes(pair.Input(), indices);
  int right = 0, wrong = 0;
  for (size_t i = 0; i < indices.size(); ++i) {
    (pair.is_inlier[i] ? right : wrong) += consensus.votes[i] >= 2;
  }
  EXPECT_GE(right, 90);
  EXPECT_LE(wrong, 60);
  EXPECT_GT(consensus.num_votes, 5.0 * consensus.num_votes_by_chance);
}

TEST(LocalConsensus, CountsWhatChanceGives) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const Pair pair = MakeSmoothPair(0, 400, seed);
    std::vector<int32_t> indices(pair.matches.size());
    std::iota(indices.begin(), indices.end(), 0);
    const LocalConsensus consensus = CountVotes(pair.Input(), indices);
    EXPECT_GT(consensus.num_votes_by_chance, 1.0);
    EXPECT_LT(consensus.num_votes, 3.0 * consensus.num_votes_by_chance + 5.0);
  }
}

TEST(LocalConsensus, DoesNotDependOnTheOrderOfMatches) {
  const Pair pair = MakeSmoothPair(60, 60, 2);
  std::vector<int32_t> indices(pair.matches.size()), shuffled;
  std::iota(indices.begin(), indices.end(), 0);
  shuffled = indices;
  Rng(3).Shuffle(shuffled);
  const LocalConsensus a = CountVotes(pair.Input(), indices);
  const LocalConsensus b = CountVotes(pair.Input(), shuffled);
  for (size_t k = 0; k < shuffled.size(); ++k) EXPECT_EQ(b.votes[k], a.votes[shuffled[k]]);
}

TEST(PreparePair, PutsSupportedMatchesFirst) {
  const Pair pair = MakeSmoothPair(100, 300, 4);
  PreparedPair prepared;
  PreparePair(pair.Input(), {}, MatchOrder::kByConsensus, &prepared);
  ASSERT_EQ(prepared.size(), 400);
  EXPECT_GE(prepared.NumSupported(), 90);
  EXPECT_GT(prepared.consensus_sigmas, 10.0);
  int right = 0;
  for (int i = 0; i < 80; ++i) right += pair.is_inlier[prepared.match_index[i]];
  EXPECT_GE(right, 75);
  // A permutation of all matches.
  std::vector<int32_t> sorted = prepared.match_index;
  std::sort(sorted.begin(), sorted.end());
  for (int i = 0; i < 400; ++i) EXPECT_EQ(sorted[i], i);
}

TEST(PreparePair, KnowsWhichMatchesAreBestWhereItIsTold) {
  const Pair pair = MakeSmoothPair(100, 300, 4);
  PairInput input = pair.Input();
  PreparedPair prepared;
  for (const MatchOrder order : {MatchOrder::kByConsensus, MatchOrder::kGiven}) {
    input.are_best_first = true;
    PreparePair(input, {}, order, &prepared);
    ASSERT_EQ(prepared.best_first.size(), 400u);
    for (int k = 0; k < 400; ++k) EXPECT_EQ(prepared.match_index[prepared.best_first[k]], k);
    input.are_best_first = false;
    PreparePair(input, {}, order, &prepared);
    EXPECT_TRUE(prepared.best_first.empty());
  }
}

TEST(PreparePair, SubsetsKeepVotesAndMatches) {
  const Pair pair = MakeSmoothPair(100, 600, 4);
  PreparedPair prepared;
  PreparePair(pair.Input(), {}, MatchOrder::kByConsensus, &prepared);
  std::vector<int32_t> every_third;
  for (int i = 0; i < prepared.size(); i += 3) every_third.push_back(i);
  const PreparedPair subset = prepared.Subset(every_third);
  ASSERT_EQ(subset.size(), 234);
  EXPECT_EQ(subset.NumSupported(), (prepared.NumSupported() + 2) / 3);
  for (int k = 0; k < subset.size(); ++k) {
    EXPECT_EQ(subset.Match(k), prepared.Match(3 * k));
    EXPECT_EQ(subset.points.Point2(k), prepared.points.Point2(3 * k));
  }
}

TEST(PreparePair, VoteClassesFollowEachOther) {
  const Pair pair = MakeSmoothPair(100, 600, 4);
  PreparedPair prepared;
  PreparePair(pair.Input(), {}, MatchOrder::kByConsensus, &prepared);
  const auto& ends = prepared.vote_class_end;
  EXPECT_TRUE(std::is_sorted(ends.begin(), ends.end()));
  EXPECT_EQ(ends[1], prepared.NumSupported());
  EXPECT_EQ(ends[2], 512);  // asked
  EXPECT_EQ(ends[3], 700);
  PreparePair(pair.Input(), {}, MatchOrder::kGiven, &prepared);
  EXPECT_EQ(prepared.vote_class_end, (std::array<int, 4>{0, 0, 0, 700}));
}

// Two motions explain as many matches each, the first one those that have votes.
TEST(GuidedSupport, TrustsTheClassThatProvedRight) {
  const Pair first = MakePair({.num_inliers = 30, .num_outliers = 0}, 1);
  const Pair second = MakePair({.num_inliers = 30, .num_outliers = 100}, 2);
  PreparedPair a, both;
  PreparePair(first.Input(), {.max_error_px = 1.0}, MatchOrder::kGiven, &a);
  PreparePair(second.Input(), {.max_error_px = 1.0}, MatchOrder::kGiven, &both);
  const PreparedPair b = std::move(both);
  both = {};
  both.max_error_px = 1.0;
  both.chance_per_px = a.chance_per_px;
  both.points.Reset(160, a.points.focal1_px(), a.points.focal2_px());
  for (int i = 0; i < 30; ++i) both.points.Set(i, a.points.Point1(i), a.points.Point2(i));
  for (int i = 0; i < 130; ++i) both.points.Set(30 + i, b.points.Point1(i), b.points.Point2(i));
  const Eigen::Matrix3d E1 = EssentialFromPose(first.cam2_from_cam1);
  const Eigen::Matrix3d E2 = EssentialFromPose(second.cam2_from_cam1);
  const MatchErrors errors(both.points, E1);
  constexpr double kReachPx = 1e6;
  GuidedSupport support;
  both.vote_class_end.fill(160);
  support.Learn(both, errors.values(), kReachPx);
  EXPECT_LT(support.Score(E1), 1.3 * support.Score(E2));
  both.vote_class_end = {30, 30, 160, 160};
  support.Learn(both, errors.values(), kReachPx);
  EXPECT_GT(support.Score(E1), 2.0 * support.Score(E2));
}

TEST(PreparePair, LeavesOutWhatTheCameraCannotSee) {
  Pair pair = MakePair({}, 1);
  pair.camera2.params.back() = -2.0;  // folds over within the image
  PreparedPair prepared;
  PreparePair(pair.Input(), {}, MatchOrder::kByConsensus, &prepared);
  EXPECT_LT(prepared.size(), static_cast<int>(pair.matches.size()));
  EXPECT_EQ(prepared.size(), static_cast<int>(prepared.match_index.size()));
  EXPECT_LE(prepared.NumSupported(), prepared.size());
}

TEST(PreparePair, ThresholdFollowsTheImageSize) {
  Pair pair = MakePair({}, 1);
  PreparedPair prepared;
  PreparePair(pair.Input(), {}, MatchOrder::kGiven, &prepared);
  EXPECT_NEAR(prepared.max_error_px, 0.001 * pair.camera1.DiagonalPx(), 1e-9);
  pair.camera1.width = pair.camera2.width = 320;
  pair.camera1.height = pair.camera2.height = 240;
  PreparePair(pair.Input(), {}, MatchOrder::kGiven, &prepared);
  EXPECT_EQ(prepared.max_error_px, 1.0);
  PreparePair(pair.Input(), {.max_error_px = 2.5}, MatchOrder::kGiven, &prepared);
  EXPECT_EQ(prepared.max_error_px, 2.5);
}

class SearchTest : public ::testing::Test {
 protected:
  void Prepare(const Pair& pair, const TwoViewOptions& options = {}) {
    PreparePair(pair.Input(), options, MatchOrder::kByConsensus, &prepared_);
  }
  PreparedPair prepared_;
  const TwoViewOptions options_{};
};

TEST_F(SearchTest, ConvergesFromARoughHypothesis) {
  const Pair pair = MakePair({.num_inliers = 150, .num_outliers = 100}, 7);
  Prepare(pair);
  PoseSearch search(prepared_, options_);
  EXPECT_FALSE(search.HasModel());
  Rng rng(7);
  for (int k = 0; k < 10; ++k) {
    const Eigen::Vector3d translation =
        pair.cam2_from_cam1.translation + 0.15 * RandomDirection(rng);
    const Rigid3d rough(ExpSO3(0.06 * RandomDirection(rng)) * pair.cam2_from_cam1.rotation,
                        translation);
    search.Add(EssentialFromPose(rough));
  }
  search.RefineBest(10);
  EXPECT_TRUE(search.HasConverged());
  EXPECT_TRUE(search.HasEvidence());
  EXPECT_EQ(search.num_hypotheses(), 10);
  EXPECT_GT(search.best().score, 80.0);
  EXPECT_LT(HomogeneousError(EssentialFromPose(search.best().pose),
                             EssentialFromPose(pair.cam2_from_cam1)),
            0.01);
}

TEST_F(SearchTest, DoesNotConvergeOnChance) {
  const Pair pair = MakePair({.num_inliers = 0, .num_outliers = 300}, 8);
  Prepare(pair);
  PoseSearch search(prepared_, options_);
  RunFivePointStep(prepared_, 100, &search);
  EXPECT_TRUE(search.HasModel());
  EXPECT_FALSE(search.HasEvidence());
  EXPECT_FALSE(search.HasConverged());
}

// Any of the four poses of an essential matrix may stand for it.
double EssentialError(const Rigid3d& pose, const Pair& pair) {
  return HomogeneousError(EssentialFromPose(pose), EssentialFromPose(pair.cam2_from_cam1));
}

TEST_F(SearchTest, ResamplingTradesLittleSupportForAccuracy) {
  double sum_before = 0.0, sum_after = 0.0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const Pair pair = MakePair({.num_inliers = 80, .num_outliers = 100, .noise_px = 0.6}, seed);
    Prepare(pair);
    PoseSearch search(prepared_, options_);
    RunTwoAcStep(prepared_, 200, &search);
    const double before = search.best().score;
    const double error_before = EssentialError(search.best().pose, pair);
    int64_t num_hypotheses = 0;
    const Rigid3d after = ResamplePose(prepared_, search.best(), {}, &num_hypotheses);
    EXPECT_GT(num_hypotheses, 10);
    const double score =
        ScoreSampson(prepared_.points, EssentialFromPose(after), prepared_.max_error_px);
    EXPECT_GE(score, 0.9 * before);
    sum_before += error_before;
    sum_after += EssentialError(after, pair);
  }
  EXPECT_LE(sum_after, sum_before);
}

TEST_F(SearchTest, RoughScaleDecidesWhatIsRefined) {
  const Pair pair = MakePair({.noise_px = 1.0, .depth_noise = 0.2}, 9);
  Prepare(pair);
  auto first_pose = [&](const TwoViewOptions& options) {
    PoseSearch search(prepared_, options);
    EXPECT_GT(RunOneAcDepthStep(prepared_, 1, &search), 100);
    return search.best().pose.translation;
  };
  const Eigen::Vector3d pose = first_pose({});
  EXPECT_EQ(first_pose({}), pose);
  EXPECT_NE(first_pose({.rough_error_factor = 50.0}), pose);
}

// Two motions: one has more matches on its epipolar lines, the other more in front of the cameras.
TEST(PoseSearch, OnlyPointsInFrontOfBothCamerasSpeakForAPose) {
  const Rigid3d true_pose(ExpSO3(Eigen::Vector3d(0.1, -0.2, 0.1)), Eigen::Vector3d(0.8, 0.6, 0.0));
  const Rigid3d wrong_pose(ExpSO3(Eigen::Vector3d(-0.2, 0.1, 0.3)), Eigen::Vector3d(0.0, 0.6, 0.8));
  struct Matches {
    int in_front, behind;  // of the wrong pose
  };
  for (const auto [in_front, behind] : {Matches{50, 40}, Matches{60, 15}}) {
    Rng rng(5);
    PreparedPair pair;
    pair.points.Reset(70 + in_front + behind, 1000.0, 1000.0);
    int num_points = 0;
    auto add = [&](const Rigid3d& pose, bool in_front, int count) {
      while (count > 0) {
        const Eigen::Vector2d x1 = UniformVector({{-0.6, 0.6}, {-0.6, 0.6}}, rng);
        const Eigen::Vector3d X2 =
            pose * Eigen::Vector3d(rng.Uniform(-0.7, 4.0) * x1.homogeneous());
        const Eigen::Vector3d X1 = Inverse(pose) * X2;
        const bool is_in_front = X1.z() > 0.0 && X2.z() > 0.0;
        if (is_in_front != in_front || (!in_front && X1.z() * X2.z() > 0.0)) continue;
        const Eigen::Vector2d x2 = X2.hnormalized();
        if (!(x2.cwiseAbs().maxCoeff() < 0.8)) continue;
        pair.points.Set(num_points++, x1, x2);
        --count;
      }
    };
    add(true_pose, true, 70);
    add(wrong_pose, true, in_front);
    add(wrong_pose, false, behind);
    const TwoViewOptions options;
    for (const bool wrong_first : {true, false}) {
      PoseSearch search(pair, options);
      search.AddRefined(wrong_first ? wrong_pose : true_pose);
      search.AddRefined(wrong_first ? true_pose : wrong_pose);
      EXPECT_LT(PoseError(search.best().pose, true_pose), 1e-6) << behind;
    }
  }
}

// A threshold that is wide for a pair costs no accuracy.
TEST(ResamplePose, GoesByTheNoiseOfThePair) {
  auto sum_of_errors = [](double max_error_px) {
    double sum = 0.0;
    const auto verifier = MakePairVerifier(VerifierKind::kCascade, {.max_error_px = max_error_px});
    for (uint64_t seed = 0; seed < 100; ++seed) {
      const Pair pair = MakePair({.num_inliers = 80, .num_outliers = 300, .noise_px = 0.3}, seed);
      const PairReport report = verifier->Verify(pair.Input());
      sum += EssentialError(report.geometry.cam2_from_cam1.value(), pair);
    }
    return sum;
  };
  EXPECT_LE(sum_of_errors(4.0), sum_of_errors(1.0));
}

// The same of resampling: most matches are on the epipolar lines of both motions.
TEST(ResamplePose, LeavesAPoseThatHasMostPointsBehindACamera) {
  const Rigid3d true_pose(ExpSO3(Eigen::Vector3d(0.1, -0.2, 0.1)), Eigen::Vector3d(0.8, 0.6, 0.0));
  const Rigid3d wrong_pose(ExpSO3(Eigen::Vector3d(-0.2, 0.1, 0.3)), Eigen::Vector3d(0.0, 0.6, 0.8));
  const Eigen::Matrix3d wrong_E = EssentialFromPose(wrong_pose);
  constexpr int kNumBoth = 90, kNumWrong = 10;
  Rng rng(5);
  PreparedPair pair;
  pair.points.Reset(kNumBoth + kNumWrong, 1000.0, 1000.0);
  pair.vote_class_end.fill(kNumBoth + kNumWrong);
  for (int i = 0; i < kNumBoth + kNumWrong;) {
    const Eigen::Vector3d x1 = UniformVector({{-0.6, 0.6}, {-0.6, 0.6}}, rng).homogeneous();
    const bool is_of_both = i < kNumBoth;
    const Rigid3d& pose = is_of_both ? true_pose : wrong_pose;
    const Eigen::Vector3d line = wrong_E * x1;
    // Where the true motion meets the wrong one's epipolar line.
    const double depth = is_of_both
                             ? -line.dot(true_pose.translation) / line.dot(true_pose.rotation * x1)
                             : rng.Uniform(1.0, 4.0);
    const Eigen::Vector3d X2 = pose * Eigen::Vector3d(depth * x1);
    if (!(depth > 0.5 && depth < 10.0 && X2.z() > 0.1)) continue;
    const Eigen::Vector2d x2 = X2.hnormalized();
    if (!(x2.cwiseAbs().maxCoeff() < 0.8)) continue;
    if (is_of_both && CheiralityTest(wrong_pose).IsInFront(x1, x2.homogeneous())) continue;
    pair.points.Set(i++, x1.head<2>(), x2);
  }
  int64_t num_hypotheses = 0;
  const FoundPose start{wrong_pose, wrong_E, kNumBoth + kNumWrong};
  // All hypotheses are tried: of exact matches, those of the wrong motion have more support.
  const Rigid3d found = ResamplePose(pair, start, {.effort = 100}, &num_hypotheses);
  EXPECT_LT(HomogeneousError(EssentialFromPose(found), EssentialFromPose(true_pose)), 1e-3);
}

TEST(Evidence, GrowsWithInliersAndFallsWithMatches) {
  const double chance = 0.0012;
  auto nfa = [&](int n, int k) { return Log10NumFalseAlarms(n, k, kEssential, chance); };
  EXPECT_LT(nfa(20, 15), -6.0);  // 15 of 20 good ones are kept
  EXPECT_GT(nfa(600, 15), 0.0);  // 15 chance inliers among 600 are not
  EXPECT_LT(nfa(600, 40), -6.0);
  EXPECT_LT(nfa(100, 20), nfa(100, 19));
  EXPECT_LT(nfa(100, 20), nfa(200, 20));
  EXPECT_GT(nfa(100, 5), 0.0);
}

TEST(Evidence, MatchesOfOneSpotCountOnce) {
  const Pair pair = MakePair({.num_inliers = 50, .num_outliers = 0}, 1);
  Pair repeated = pair;
  for (int k = 0; k < 30; ++k) repeated.matches.push_back(pair.matches[0]);
  PreparedPair prepared;
  PreparePair(repeated.Input(), {}, MatchOrder::kGiven, &prepared);
  std::vector<int32_t> all(prepared.size());
  std::iota(all.begin(), all.end(), 0);
  EXPECT_LE(EstimateNumDistinct(prepared, all), 50);
  EXPECT_GE(EstimateNumDistinct(prepared, all), 48);
  EXPECT_EQ(EstimateNumDistinct(prepared, {}), 0);
}

TEST(Evidence, ChanceIsMeasuredOnTheImageItself) {
  const Pair pair = MakePair({.num_inliers = 400, .num_outliers = 0}, 1);
  PreparedPair prepared;
  PreparePair(pair.Input(), {}, MatchOrder::kGiven, &prepared);
  const Eigen::Matrix3d E = EssentialFromPose(pair.cam2_from_cam1);
  const double chance = ChanceOfInlier(prepared, E, 1.0);
  EXPECT_GT(chance, 2e-4);
  EXPECT_LT(chance, 1e-2);
  EXPECT_GT(ChanceOfInlier(prepared, E, 20.0), 5.0 * chance);
}

// Frames that say nothing: only positions and depths are left.
Pair MakeFramelessPair(const PairSettings& settings, uint64_t seed) {
  Pair pair = MakePair(settings, seed);
  Rng rng(seed, "shapes");
  for (auto* keypoints : {&pair.keypoints1, &pair.keypoints2}) {
    for (Keypoint& k : *keypoints) {
      for (float* a : {&k.a11, &k.a12, &k.a21, &k.a22}) *a = static_cast<float>(rng.Gaussian());
    }
  }
  return pair;
}

TEST(TriangleDepthStep, FindsThePoseAmongManyWrongMatchesWithoutFrames) {
  int num_found = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Pair pair = MakeFramelessPair({.num_inliers = 40, .num_outliers = 160}, seed);
    PreparedPair prepared;
    PreparePair(pair.Input(), {}, MatchOrder::kByConsensus, &prepared);
    const TwoViewOptions options;
    PoseSearch search(prepared, options);
    RunTriangleStep(prepared, 4000, &search);
    num_found += search.HasEvidence() && EssentialError(search.best().pose, pair) < 0.035;
  }
  EXPECT_GE(num_found, 16);
}

TEST(TriangleDepthStep, NeedsDepthInBothImages) {
  Pair pair = MakeFramelessPair({}, 1);
  PreparedPair prepared;
  PreparePair(pair.Input(), {}, MatchOrder::kByConsensus, &prepared);
  const TwoViewOptions options;
  PoseSearch search(prepared, options);
  for (DepthSample& sample : pair.depth2) sample.is_valid = false;
  RunTriangleStep(prepared, 100, &search);
  EXPECT_FALSE(search.HasModel());
}

TEST(TriangleDepthStep, ItsBudgetDecidesWhatTheCascadeFinds) {
  auto num_verified = [](int max_depth_triangles) {
    TwoViewOptions options;
    options.max_depth_triangles = max_depth_triangles;
    options.max_fallback_samples = 0;
    const auto verifier = MakePairVerifier(VerifierKind::kCascade, options);
    int count = 0;
    for (uint64_t seed = 0; seed < 10; ++seed) {
      const Pair pair = MakeFramelessPair({.num_inliers = 40, .num_outliers = 160}, seed);
      count += verifier->Verify(pair.Input()).status == PairStatus::kVerified;
    }
    return count;
  };
  EXPECT_GT(num_verified(4000), num_verified(1) + 5);
}

// Samples are drawn from the matches with votes: how many of these are right tells when to stop.
TEST(FindFundamental, StopsByTheShareOfThoseThatItDrawsFrom) {
  constexpr int kNumMatches = 2000, kNumVoters = 200;
  int num_found = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const TwoViewScene scene = RandomScene(rng, kNumMatches);
    const Camera camera = MakeCamera(1, 1000.0, 0.0);
    PreparedPair prepared;
    prepared.input.seed = seed;
    prepared.input.camera1 = prepared.input.camera2 = &camera;
    prepared.consensus_sigmas = 10.0;
    prepared.vote_class_end = {kNumVoters, kNumVoters, kNumMatches, kNumMatches};
    prepared.points.Reset(kNumMatches, 1000.0, 1000.0);
    int num_right = 0;
    for (int i = 0; i < kNumMatches; ++i) {
      PointCorrespondence x = scene.patches[i].points();
      const bool is_right = i % (i < kNumVoters ? 2 : 3) == 0;
      if (!is_right) x.x2 = {rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5)};
      for (Eigen::Vector2d* point : {&x.x1, &x.x2}) {
        *point += 3e-4 * GaussianVector<2>(rng);
      }
      prepared.points.Set(i, x.x1, x.x2);
      prepared.match_index.push_back(i);
      num_right += is_right;
    }
    const auto model = FindFundamental(
        prepared, {.confidence = 0.99, .min_iterations = 1, .max_iterations = 2000});
    num_found += model && static_cast<double>(model->inliers.size()) > 0.85 * num_right;
  }
  EXPECT_GE(num_found, 18);
}

TEST(PairNoise, IsThatOfTheRightMatches) {
  for (const double noise_px : {0.2, 0.5, 1.0}) {
    const Pair pair =
        MakePair({.num_inliers = 2000, .num_outliers = 2000, .noise_px = noise_px}, 3);
    PreparedPair prepared;
    PreparePair(pair.Input(), {.max_error_px = 2.0}, MatchOrder::kGiven, &prepared);
    const MatchErrors errors(prepared.points, EssentialFromPose(pair.cam2_from_cam1));
    // Noise of both points adds up to noise_px across the epipolar line.
    EXPECT_NEAR(NoiseScalePx(prepared, errors.values(), kSigmaOfMedian), noise_px, 0.15 * noise_px);
  }
}

}  // namespace
}  // namespace cairn::internal
