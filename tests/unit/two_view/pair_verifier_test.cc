#include "cairn/two_view/pair_verifier.h"

#include <algorithm>
#include <set>

#include "cairn/base/error.h"
#include "support/test.h"
#include "two_view/pair_fixture.h"

namespace cairn {
namespace {

class Verifiers : public ::testing::TestWithParam<VerifierKind> {
 protected:
  std::unique_ptr<PairVerifier> Make(const TwoViewOptions& options = {}) const {
    return MakePairVerifier(GetParam(), options);
  }
};
INSTANTIATE_TEST_SUITE_P(All, Verifiers,
                         ::testing::Values(VerifierKind::kCascade, VerifierKind::kFast,
                                           VerifierKind::kOneAcDepth, VerifierKind::kTwoAc,
                                           VerifierKind::kFivePoint),
                         [](const auto& info) {
                           return std::string(VerifierKindName(info.param));
                         });

TEST_P(Verifiers, FindPoseAndInliers) {
  const auto verifier = Make();
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Pair pair = MakePair({}, seed);
    const PairReport report = verifier->Verify(pair.Input());
    ASSERT_EQ(report.status, PairStatus::kVerified) << seed;
    // A cascade says which step won.
    const bool is_cascade =
        GetParam() == VerifierKind::kCascade || GetParam() == VerifierKind::kFast;
    EXPECT_EQ(report.verifier, is_cascade ? "one_ac_depth" : VerifierKindName(GetParam()));
    const TwoViewGeometry& geometry = report.geometry;
    EXPECT_EQ(geometry.config, TwoViewConfig::kCalibrated);
    EXPECT_LT(PoseErrorDeg(report, pair), 1.0);
    EXPECT_NEAR(geometry.cam2_from_cam1->translation.norm(), 1.0, 1e-12);
    EXPECT_EQ(report.num_inliers, static_cast<int>(geometry.inlier_matches.size()));
    EXPECT_GE(report.num_inliers, 140);
    EXPECT_LE(report.num_inliers, 157);
    EXPECT_GT(report.score, 100.0);
    EXPECT_LE(report.score, report.num_inliers);
    EXPECT_GT(report.residual_px, 0.05);
    EXPECT_LT(report.residual_px, 0.5);
    EXPECT_GT(report.triangulation_angle_deg, 1.0);
    EXPECT_GT(report.num_iterations, 0);
    EXPECT_FALSE(geometry.H.has_value());
    // E and F of the same pose, F in pixels.
    EXPECT_LT(HomogeneousError(*geometry.E, EssentialFromPose(*geometry.cam2_from_cam1)), 1e-9);
    const auto& match = geometry.inlier_matches.front();
    EXPECT_LT(SquaredSampsonError(*geometry.F, pair.keypoints1[match.point1].Position(),
                                  pair.keypoints2[match.point2].Position()),
              1.2);
  }
}

TEST_P(Verifiers, SwappedImagesInvertThePose) {
  const Pair pair = MakePair({}, 3);
  const Pair swapped = pair.Swapped();
  const auto verifier = Make();
  const PairReport there = verifier->Verify(pair.Input());
  const PairReport back = verifier->Verify(swapped.Input());
  ASSERT_EQ(there.status, PairStatus::kVerified);
  ASSERT_EQ(back.status, PairStatus::kVerified);
  EXPECT_LT(PoseError(Inverse(*there.geometry.cam2_from_cam1), *back.geometry.cam2_from_cam1),
            1e-3);
  EXPECT_EQ(there.num_inliers, back.num_inliers);
}

// Its noise and its threshold shrink with the image.
TEST_P(Verifiers, AnImageOfHalfTheSizeIsAsGood) {
  const Pair pair = MakePair({.noise_px = 1.0}, 8);
  Pair resized = pair;
  resized.camera2 = Camera::FromFocal(2, CameraModel::kSimpleRadial, 600, 800, 800);
  resized.camera2.has_prior_focal_length = true;
  for (Keypoint& k : resized.keypoints2) {
    k = {k.x / 2, k.y / 2, k.a11 / 2, k.a12 / 2, k.a21 / 2, k.a22 / 2};
  }
  for (DepthSample& sample : resized.depth2) {
    sample.ddepth_dx *= 2;
    sample.ddepth_dy *= 2;
  }
  const PairReport whole = Make()->Verify(pair.Input()), half = Make()->Verify(resized.Input());
  ASSERT_EQ(whole.status, PairStatus::kVerified);
  ASSERT_EQ(half.status, PairStatus::kVerified);
  EXPECT_TRUE(whole.geometry.inlier_matches == half.geometry.inlier_matches);
  EXPECT_LT(PoseError(*whole.geometry.cam2_from_cam1, *half.geometry.cam2_from_cam1), 1e-4);
}

TEST_P(Verifiers, ResultDoesNotDependOnWhatWasVerifiedBefore) {
  const Pair pair = MakePair({}, 4);
  const auto fresh = Make(), used = Make();
  used->Verify(MakePair({.num_inliers = 400}, 5).Input());
  const PairReport a = fresh->Verify(pair.Input()), b = used->Verify(pair.Input());
  EXPECT_EQ(a.geometry.cam2_from_cam1->translation, b.geometry.cam2_from_cam1->translation);
  EXPECT_EQ(a.geometry.cam2_from_cam1->rotation.coeffs(),
            b.geometry.cam2_from_cam1->rotation.coeffs());
  EXPECT_EQ(a.geometry.inlier_matches, b.geometry.inlier_matches);
  EXPECT_EQ(a.score, b.score);
}

TEST_P(Verifiers, UndistortPoints) {
  const Pair pair = MakePair({.noise_px = 0.2, .distortion = -0.15}, 6);
  const PairReport report = Make()->Verify(pair.Input());
  ASSERT_EQ(report.status, PairStatus::kVerified);
  EXPECT_LT(PoseErrorDeg(report, pair), 0.5);
}

TEST_P(Verifiers, RejectUnrelatedImagesAndKeepGoodSmallSets) {
  const auto verifier = Make();
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const Pair unrelated = MakePair({.num_inliers = 0, .num_outliers = 600}, seed);
    EXPECT_EQ(verifier->Verify(unrelated.Input()).status, PairStatus::kTooFewInliers);
    const Pair small = MakePair({.num_inliers = 18, .num_outliers = 4}, seed);
    const PairReport report = verifier->Verify(small.Input());
    EXPECT_EQ(report.status, PairStatus::kVerified);
    EXPECT_GE(report.num_inliers, 15) << seed;
  }
}

TEST_P(Verifiers, SayWhyAPairWasNotTried) {
  const Pair few = MakePair({.num_inliers = 19, .num_outliers = 0}, 1);
  EXPECT_EQ(Make()->Verify(few.Input()).status, PairStatus::kTooFewMatches);
  EXPECT_EQ(Make({.min_num_matches = 10})->Verify(few.Input()).status, PairStatus::kVerified);
  Pair none = few;
  none.matches.clear();
  EXPECT_EQ(Make()->Verify(none.Input()).status, PairStatus::kTooFewMatches);
}

TEST_P(Verifiers, CoincidentPointsAreNoModel) {
  Pair pair = MakePair({}, 1);
  for (auto& keypoint : pair.keypoints1) keypoint.x = keypoint.y = 700.0f;
  for (auto& keypoint : pair.keypoints2) keypoint.x = keypoint.y = 600.0f;
  EXPECT_NE(Make()->Verify(pair.Input()).status, PairStatus::kVerified);
}

TEST_P(Verifiers, OptionsDecideWhatIsAccepted) {
  const Pair pair = MakePair({}, 8);
  EXPECT_EQ(Make({.min_num_inliers = 180})->Verify(pair.Input()).status,
            PairStatus::kTooFewInliers);
  const Pair small = MakePair({.num_inliers = 40, .num_outliers = 40}, 8);
  EXPECT_EQ(Make()->Verify(small.Input()).status, PairStatus::kVerified);
  EXPECT_EQ(Make({.min_log10_evidence = 300.0})->Verify(small.Input()).status,
            PairStatus::kTooFewInliers);
  EXPECT_EQ(Make({.max_pose_sigma_deg = 0.0})->Verify(pair.Input()).status,
            PairStatus::kDegenerate);
  EXPECT_LT(Make({.max_error_px = 0.2})->Verify(pair.Input()).num_inliers,
            Make({.max_error_px = 2.0})->Verify(pair.Input()).num_inliers);
}

TEST(OneAcDepthVerifier, NeedsDepthInBothImages) {
  Pair pair = MakePair({}, 1);
  const auto verifier = MakePairVerifier(VerifierKind::kOneAcDepth, {});
  EXPECT_EQ(verifier->Verify(pair.Input(false)).status, PairStatus::kNoDepth);
  for (auto& sample : pair.depth2) sample.is_valid = false;
  EXPECT_EQ(verifier->Verify(pair.Input()).status, PairStatus::kNoDepth);
}

TEST(OneAcDepthVerifier, WorksWhenMostDepthsAreMissing) {
  Pair pair = MakePair({}, 2);
  for (size_t i = 0; i < pair.depth1.size(); ++i) pair.depth1[i].is_valid = i % 10 == 0;
  const auto verifier = MakePairVerifier(VerifierKind::kOneAcDepth, {});
  const PairReport report = verifier->Verify(pair.Input());
  ASSERT_EQ(report.status, PairStatus::kVerified);
  EXPECT_LT(PoseErrorDeg(report, pair), 0.5);
}

TEST(CascadeVerifier, EachStepTakesOverWhereTheOneBeforeHasNothing) {
  const Pair pair = MakePair({}, 5);
  const auto verifier = MakePairVerifier(VerifierKind::kCascade, {});
  EXPECT_EQ(verifier->Verify(pair.Input(true)).verifier, "one_ac_depth");
  EXPECT_EQ(verifier->Verify(pair.Input(false)).verifier, "two_ac");
  Pair without_frames = pair;
  Rng rng(1);
  for (auto* keypoints : {&without_frames.keypoints1, &without_frames.keypoints2}) {
    for (Keypoint& k : *keypoints) {
      k = Keypoint::FromScaleOrientation(k.x, k.y, 3.0f, static_cast<float>(rng.Uniform(0.0, 6.0)));
    }
  }
  const PairReport report = MakePairVerifier(VerifierKind::kCascade, {.max_affine_samples = 5})
                                ->Verify(without_frames.Input(false));
  EXPECT_EQ(report.verifier, "five_point");
  EXPECT_EQ(report.status, PairStatus::kVerified);
  EXPECT_LT(PoseErrorDeg(report, pair), 0.5);
  const auto fast = MakePairVerifier(VerifierKind::kFast, {.max_affine_samples = 5});
  EXPECT_NE(fast->Verify(without_frames.Input(false)).status, PairStatus::kVerified);
}

TEST(CascadeVerifier, BudgetsBoundTheNumberOfHypotheses) {
  const Pair unrelated = MakePair({.num_inliers = 0, .num_outliers = 200}, 6);
  auto iterations = [&](const TwoViewOptions& options) {
    return MakePairVerifier(VerifierKind::kCascade, options)
        ->Verify(unrelated.Input())
        .num_iterations;
  };
  const int64_t all = iterations({});
  EXPECT_LT(iterations({.max_affine_samples = 30}), all);
  EXPECT_LT(iterations({.max_fallback_samples = 0}), all);
  EXPECT_LT(iterations({.max_depth_triangles = 100}), all);
  EXPECT_GT(iterations({.unsupported_budget = 1.0}), 2 * all);
}

// Features of other programs may be positions alone: their frames predict nothing, and are no
// reason to search less.
TEST(CascadeVerifier, WithoutFramesTakesTrianglesOrFivePointsByTheFullBudget) {
  auto without_frames = [](Pair pair) {
    for (auto* keypoints : {&pair.keypoints1, &pair.keypoints2}) {
      for (Keypoint& keypoint : *keypoints) keypoint = {.x = keypoint.x, .y = keypoint.y};
    }
    return pair;
  };
  const auto cascade = MakePairVerifier(VerifierKind::kCascade, {});
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Pair pair = without_frames(MakePair({}, seed));
    const PairReport with_depth = cascade->Verify(pair.Input());
    EXPECT_EQ(with_depth.verifier, "triangles") << seed;
    EXPECT_LT(PoseErrorDeg(with_depth, pair), 1.0) << seed;
    const PairReport without_depth = cascade->Verify(pair.Input(false));
    EXPECT_EQ(without_depth.verifier, "five_point") << seed;
    EXPECT_LT(PoseErrorDeg(without_depth, pair), 1.0) << seed;
    // A quarter of right matches, and no depth: hardly ever found in the first tenth of the
    // samples.
    const Pair hard = without_frames(MakePair({.num_inliers = 60, .num_outliers = 180}, seed));
    EXPECT_LT(PoseErrorDeg(cascade->Verify(hard.Input(false)), hard), 1.0) << seed;
  }
  const Pair wrong = without_frames(MakePair({.num_inliers = 0, .num_outliers = 300}, 1));
  const TwoViewOptions few{.max_iterations = 1000, .max_depth_triangles = 100};
  const auto iterations = [&](const TwoViewOptions& options, bool with_depth) {
    return MakePairVerifier(VerifierKind::kCascade, options)
        ->Verify(wrong.Input(with_depth))
        .num_iterations;
  };
  EXPECT_GT(iterations({}, false), 10000);
  EXPECT_LT(iterations(few, false), 0.2 * iterations({}, false));
  EXPECT_LT(iterations(few, true), iterations({.max_iterations = 1000}, true));
}

TEST(FivePointVerifier, IsDeterministicAndDependsOnTheSeed) {
  const Pair pair = MakePair({.num_inliers = 60, .num_outliers = 140}, 4);
  const auto verifier = MakePairVerifier(VerifierKind::kFivePoint, {});
  PairInput input = pair.Input();
  EXPECT_EQ(verifier->Verify(input).num_iterations, verifier->Verify(input).num_iterations);
  std::set<int64_t> iterations;
  for (input.seed = 0; input.seed < 10; ++input.seed) {
    iterations.insert(verifier->Verify(input).num_iterations);
  }
  EXPECT_GT(iterations.size(), 1u);
}

TEST(FivePointVerifier, ItsOptionsChangeWhatItDoes) {
  const Pair pair = MakePair({}, 4);
  auto iterations = [&](const TwoViewOptions& options) {
    return MakePairVerifier(VerifierKind::kFivePoint, options)->Verify(pair.Input()).num_iterations;
  };
  EXPECT_GT(iterations({}), iterations({.max_iterations = 7, .num_resamples = 0}));
  EXPECT_GT(iterations({}), iterations({.num_resamples = 0}));
  // Nothing ends these before all are drawn.
  EXPECT_THROW(iterations({.num_resamples = 1000000000}), ConfigError);
}

// One in ten matches is right. Samples come from the best of them, where that is known.
TEST(FivePointVerifier, DrawsFromTheBestMatchesFirst) {
  int num_ranked = 0, num_unranked = 0;
  for (uint64_t seed = 0; seed < 5; ++seed) {
    Pair pair = MakePair({.num_inliers = 40, .num_outliers = 360}, seed);
    const auto verifier = MakePairVerifier(VerifierKind::kFivePoint, {.max_iterations = 1000});
    num_unranked += PoseErrorDeg(verifier->Verify(pair.Input()), pair) < 1.0;
    // Right ones among the first 40 of 80, the others behind.
    FeatureMatches right, wrong;
    for (size_t i = 0; i < pair.matches.size(); ++i) {
      (pair.is_inlier[i] ? right : wrong).push_back(pair.matches[i]);
    }
    for (size_t i = 0; i < right.size(); ++i) {
      pair.matches[2 * i] = wrong[i];
      pair.matches[2 * i + 1] = right[i];
    }
    std::copy(wrong.begin() + static_cast<ptrdiff_t>(right.size()), wrong.end(),
              pair.matches.begin() + static_cast<ptrdiff_t>(2 * right.size()));
    PairInput input = pair.Input();
    input.are_best_first = true;
    num_ranked += PoseErrorDeg(verifier->Verify(input), pair) < 1.0;
  }
  EXPECT_EQ(num_ranked, 5);
  EXPECT_LT(num_unranked, 3);
}

TEST(MakePairVerifier, RefusesWrongOptionsAndNames) {
  for (const VerifierKind kind :
       {VerifierKind::kCascade, VerifierKind::kFast, VerifierKind::kOneAcDepth,
        VerifierKind::kTwoAc, VerifierKind::kFivePoint}) {
    EXPECT_THROW(MakePairVerifier(kind, {.confidence = 2.0}), ConfigError)
        << VerifierKindName(kind);
  }
  EXPECT_EQ(VerifierKindFromName("five_point"), VerifierKind::kFivePoint);
  EXPECT_THROW(VerifierKindFromName("six_point"), ConfigError);
  EXPECT_THROW(MakePairVerifier(static_cast<VerifierKind>(77), {}), ConfigError);
}

TEST(PairStatusName, IsDistinct) {
  std::set<std::string_view> names;
  for (int i = 0; i <= static_cast<int>(PairStatus::kDegenerate); ++i) {
    EXPECT_TRUE(names.insert(PairStatusName(static_cast<PairStatus>(i))).second) << i;
  }
  EXPECT_EQ(PairStatusName(PairStatus::kVerified), "verified");
  EXPECT_EQ(PairStatusName(PairStatus::kDegenerate), "degenerate");
}

}  // namespace
}  // namespace cairn
