#include "cairn/two_view/verify_pair.h"

#include <cmath>
#include <limits>

#include "cairn/base/error.h"
#include "support/test.h"
#include "support/thrown_message.h"
#include "two_view/pair_fixture.h"

namespace cairn {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The matches of a pair with known truth, as a user would have them.
struct Matches {
  explicit Matches(const Pair& pair) : truth(pair) {
    for (const FeatureMatch& match : pair.matches) {
      points1.push_back(pair.keypoints1[match.point1].Position());
      points2.push_back(pair.keypoints2[match.point2].Position());
      frames1.push_back(pair.keypoints1[match.point1].Shape());
      frames2.push_back(pair.keypoints2[match.point2].Shape());
      depths1.push_back(pair.depth1[match.point1]);
      depths2.push_back(pair.depth2[match.point2]);
    }
  }
  MatchedPoints Image1() const { return {truth.camera1, points1, frames1, depths1}; }
  MatchedPoints Image2() const { return {truth.camera2, points2, frames2, depths2}; }

  Pair truth;
  std::vector<Eigen::Vector2d> points1, points2;
  std::vector<Eigen::Matrix2d> frames1, frames2;
  std::vector<DepthSample> depths1, depths2;
};

// 150 right matches and 50 wrong ones.
Matches MakeMatches(uint64_t seed = 1) { return Matches(MakePair({}, seed)); }

TEST(VerifyPair, FindsThePoseWhateverIsKnown) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Matches m = MakeMatches(seed);
    for (const bool has_frames : {false, true}) {
      for (const bool has_depths : {false, true}) {
        MatchedPoints image1 = m.Image1(), image2 = m.Image2();
        if (!has_frames) image1.frames = image2.frames = {};
        if (!has_depths) image1.depths = image2.depths = {};
        const PairReport report = VerifyPair(image1, image2);
        ASSERT_EQ(report.status, PairStatus::kVerified) << seed << has_frames << has_depths;
        EXPECT_EQ(report.geometry.config, TwoViewConfig::kCalibrated);
        EXPECT_LT(PoseErrorDeg(report, m.truth), 1.0) << seed << has_frames << has_depths;
        EXPECT_GE(report.num_inliers, 140);
        int num_wrong = 0;
        for (const FeatureMatch& match : report.geometry.inlier_matches) {
          EXPECT_EQ(match.point1, match.point2);
          num_wrong += !m.truth.is_inlier[match.point1];
        }
        EXPECT_LE(num_wrong, 10);
      }
    }
  }
}

// Frames and depths arrive as they are given.
TEST(VerifyPair, GivesWhatThePairVerifierGives) {
  const Matches m = MakeMatches();
  Pair pair = m.truth;
  for (point2D_t i = 0; i < pair.matches.size(); ++i) {
    const FeatureMatch match = m.truth.matches[i];
    pair.keypoints1[i] = m.truth.keypoints1[match.point1];
    pair.keypoints2[i] = m.truth.keypoints2[match.point2];
    pair.depth1[i] = m.truth.depth1[match.point1];
    pair.depth2[i] = m.truth.depth2[match.point2];
    pair.matches[i] = {i, i};
  }
  PairInput input = pair.Input();
  input.pair_id = 0;
  const auto expect_same = [&](VerifierKind kind, bool are_best_first) {
    input.are_best_first = are_best_first;
    const PairReport expected = MakePairVerifier(kind, {})->Verify(input);
    const PairReport report =
        VerifyPair(m.Image1(), m.Image2(), {.verifier = kind, .are_best_first = are_best_first},
                   {.seed = input.seed});
    EXPECT_EQ(report.num_iterations, expected.num_iterations);
    EXPECT_EQ(report.score, expected.score);
    EXPECT_EQ(report.geometry.inlier_matches, expected.geometry.inlier_matches);
    EXPECT_EQ(report.geometry.cam2_from_cam1->translation,
              expected.geometry.cam2_from_cam1->translation);
    return report.score;
  };
  expect_same(VerifierKind::kOneAcDepth, false);
  EXPECT_NE(expect_same(VerifierKind::kTwoAc, true), expect_same(VerifierKind::kTwoAc, false));
}

TEST(VerifyPair, SwappedImagesInvertThePose) {
  const Matches m = MakeMatches();
  const PairReport there = VerifyPair(m.Image1(), m.Image2());
  const PairReport back = VerifyPair(m.Image2(), m.Image1());
  EXPECT_LT(PoseError(Inverse(*there.geometry.cam2_from_cam1), *back.geometry.cam2_from_cam1),
            1e-3);
}

TEST(VerifyPair, SaysWhyThereIsNoPose) {
  const Matches few(MakePair({.num_inliers = 10, .num_outliers = 0}, 1));
  EXPECT_EQ(VerifyPair(few.Image1(), few.Image2()).status, PairStatus::kTooFewMatches);
  const Matches wrong(MakePair({.num_inliers = 0, .num_outliers = 300}, 1));
  const PairReport report = VerifyPair(wrong.Image1(), wrong.Image2());
  EXPECT_EQ(report.status, PairStatus::kTooFewInliers);
  EXPECT_FALSE(report.geometry.cam2_from_cam1.has_value());
  const Rigid3d turn(Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY())),
                     Eigen::Vector3d::Zero());
  Pair panorama = MakePlanarPair(turn, true, 200, 0.3, 1);
  panorama.depth1.resize(200);
  panorama.depth2.resize(200);
  const Matches turned(panorama);
  EXPECT_EQ(VerifyPair(turned.Image1(), turned.Image2()).geometry.config,
            TwoViewConfig::kPanoramic);
}

TEST(VerifyPair, TakesVerifierOptionsAndSeed) {
  const Matches m = MakeMatches();
  const VerifyPairOptions five_point{.verifier = VerifierKind::kFivePoint};
  const PairReport report = VerifyPair(m.Image1(), m.Image2(), five_point);
  EXPECT_EQ(report.verifier, "five_point");
  const PairReport other = VerifyPair(m.Image1(), m.Image2(), five_point, {.seed = 5});
  EXPECT_NE(other.num_iterations, report.num_iterations);
  EXPECT_EQ(VerifyPair(m.Image1(), m.Image2(), {.verification = {.min_num_matches = 201}}).status,
            PairStatus::kTooFewMatches);
}

// What VerifyPair says after `spoil` changed good matches.
template <class Spoil>
std::string ErrorAfter(const Spoil& spoil) {
  Matches m = MakeMatches();
  VerifyPairOptions options;
  spoil(m, options);
  return ThrownMessage<ConfigError>([&] { VerifyPair(m.Image1(), m.Image2(), options); });
}

TEST(VerifyPair, NamesWhatIsWrong) {
  const auto error = [](auto spoil) { return ErrorAfter(spoil); };
  EXPECT_EQ(error([](auto&, auto&) {}), "no error");
  EXPECT_EQ(error([](auto& m, auto&) { m.points2.pop_back(); }),
            "points2: 199 are given, but 200 points in the first image");
  EXPECT_THAT(error([](auto& m, auto&) { m.frames1.pop_back(); }), StartsWith("frames1: 199"));
  EXPECT_THAT(error([](auto& m, auto&) { m.depths2.pop_back(); }), StartsWith("depths2: 199"));
  EXPECT_THAT(error([](auto& m, auto&) { m.frames2.clear(); }), StartsWith("frames2: only"));
  EXPECT_EQ(error([](auto& m, auto&) { m.points1[3].y() = kNaN; }), "points1[3]: is not finite");
  EXPECT_THAT(error([](auto& m, auto&) { m.frames2[4](0, 1) = kNaN; }), StartsWith("frames2[4]: "));
  EXPECT_THAT(error([](auto& m, auto&) { m.frames2[4].setZero(); }), StartsWith("frames2[4]: "));
  EXPECT_THAT(error([](auto& m, auto&) { m.depths1[5].depth = 0; }), StartsWith("depths1[5]: "));
  EXPECT_THAT(error([](auto& m, auto&) { m.depths1[5].ddepth_dx = NAN; }),
              StartsWith("depths1[5]: "));
  EXPECT_EQ(error([](auto& m, auto&) { m.depths1[5] = {.depth = 0, .is_valid = false}; }),
            "no error");
  EXPECT_THAT(error([](auto& m, auto&) { m.truth.camera2.params[0] = -1; }),
              StartsWith("camera2: "));
  EXPECT_THAT(error([](auto&, auto& options) { options.verification.confidence = 2; }),
              StartsWith("verification.confidence: "));
}

}  // namespace
}  // namespace cairn
