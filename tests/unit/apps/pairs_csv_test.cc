#include "global_sfm/pairs_csv.h"

#include "cairn/base/error.h"
#include "cairn/math/so3.h"
#include "global_sfm/describe.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

Rigid3d Pose(double angle) {
  return {ExpSO3(Eigen::Vector3d(0, angle, 0)), Eigen::Vector3d(0.6, 0, 0.8)};
}

PairMetrics Metrics(image_pair_t pair, const char* verifier, int inliers, bool is_winner) {
  PairMetrics m;
  m.pair_id = pair;
  m.verifier = m.step = verifier;
  m.status = inliers > 0 ? "verified" : "no_model";
  m.is_winner = is_winner;
  m.num_matches = 50;
  m.num_inliers = inliers;
  m.num_iterations = 100 + inliers;
  if (inliers > 0) m.cam2_from_cam1 = Pose(0.01 * inliers);
  return m;
}

// Pair (1, 2): both verifiers; (1, 3): rejected by both; (2, 3): matches only, not tried.
class PairsCsv : public ::testing::Test {
 protected:
  PairsCsv() : database_(":memory:") {
    database_.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 500, 640, 480));
    database_.WriteImage({1, "a.jpg", 1});
    database_.WriteImage({2, "b, \"2\".jpg", 1});
    database_.WriteImage({3, "c.jpg", 1});
    for (image_t id = 1; id <= 3; ++id) database_.WriteKeypoints(id, std::vector<Keypoint>(3));
    const FeatureMatches matches(50, FeatureMatch{1, 2});
    for (const image_pair_t pair : {p12_, p13_, p23_}) database_.WriteMatches(pair, matches);
    database_.WritePairMetrics(Metrics(p12_, "five_point", 30, false));
    database_.WritePairMetrics(Metrics(p12_, "one_ac_depth", 40, true));
    database_.WritePairMetrics(Metrics(p13_, "five_point", 0, false));
    database_.WritePairMetrics(Metrics(p13_, "one_ac_depth", 0, false));
    for (const image_pair_t pair : {p12_, p13_}) {
      database_.WriteTiming("verification", pair, "five_point", 0.010);
      database_.WriteTiming("verification", pair, "one_ac_depth", 0.0005);
    }
    TwoViewGeometry geometry;
    geometry.config = TwoViewConfig::kCalibrated;
    geometry.cam2_from_cam1 = Pose(0.4);
    geometry.inlier_matches.assign(40, FeatureMatch{1, 2});
    database_.WriteTwoViewGeometry(p12_, geometry);
  }

  const image_pair_t p12_ = ImagePairToPairId(1, 2);
  const image_pair_t p13_ = ImagePairToPairId(1, 3);
  const image_pair_t p23_ = ImagePairToPairId(2, 3);
  Database database_;
};

TEST_F(PairsCsv, ChosenResults) {
  const std::vector<PairRow> rows = ReadPairRows(database_, "");
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0].name1, "a.jpg");
  EXPECT_EQ(rows[0].num_matches, 50);
  EXPECT_EQ(rows[0].num_inliers, 40);
  EXPECT_EQ(rows[0].num_iterations, 130 + 140);
  EXPECT_NEAR(rows[0].milliseconds, 10.5, 1e-9);
  EXPECT_LT(AngleBetween(rows[0].cam2_from_cam1->rotation, Pose(0.4).rotation), 1e-12);
  EXPECT_EQ(rows[1].num_inliers, 0);
  EXPECT_EQ(rows[1].num_iterations, 200);
  EXPECT_NEAR(rows[1].milliseconds, 10.5, 1e-9);
  EXPECT_EQ(rows[2].name1, "b, \"2\".jpg");
  EXPECT_EQ(rows[2].num_matches, 50);
  EXPECT_EQ(rows[2].num_inliers, 0);
  EXPECT_EQ(rows[2].milliseconds, 0);
}

TEST_F(PairsCsv, ResultsOfOneVerifier) {
  const std::vector<PairRow> rows = ReadPairRows(database_, "five_point");
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0].num_inliers, 30);
  EXPECT_EQ(rows[0].num_iterations, 130);
  EXPECT_NEAR(rows[0].milliseconds, 10, 1e-9);
  EXPECT_LT(AngleBetween(rows[0].cam2_from_cam1->rotation, Pose(0.3).rotation), 1e-12);
  EXPECT_EQ(rows[1].num_inliers, 0);
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { ReadPairRows(database_, "two_ac"); }),
              HasSubstr("'two_ac' was not run; the database has five_point, "
                        "one_ac_depth"));
}

// A pair that F alone explains is not one that was rejected.
TEST_F(PairsCsv, AVerifiedPairNeedsNoPose) {
  PairMetrics of_f = Metrics(p13_, "five_point", 25, false);
  of_f.cam2_from_cam1.reset();
  database_.WritePairMetrics(of_f);
  const std::vector<PairRow> rows = ReadPairRows(database_, "five_point");
  EXPECT_EQ(rows[1].num_inliers, 25);
  EXPECT_FALSE(rows[1].cam2_from_cam1);
}

// Neither rejected pairs nor those of a mark in the frame have a pose.
TEST_F(PairsCsv, PairsWithoutPoseHaveNone) {
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kWatermark;
  geometry.inlier_matches.assign(20, FeatureMatch{1, 2});
  database_.WriteTwoViewGeometry(p23_, geometry);
  const std::vector<PairRow> rows = ReadPairRows(database_, "");
  EXPECT_TRUE(rows[0].cam2_from_cam1);
  EXPECT_FALSE(rows[1].cam2_from_cam1);
  EXPECT_EQ(rows[2].num_inliers, 20);
  EXPECT_FALSE(rows[2].cam2_from_cam1);
  EXPECT_THAT(FormatPairsCsv(rows), HasSubstr("c.jpg,50,20,0,0,,,,,,,\n"));
}

TEST_F(PairsCsv, TextIsWhatOthersExpect) {
  const std::string csv = FormatPairsCsv(ReadPairRows(database_, "five_point"));
  EXPECT_THAT(csv, HasSubstr("name1,name2,matches,inliers,iterations,ms,qw,qx,qy,qz,tx,ty,tz\n"
                             "a.jpg,\"b, \"\"2\"\".jpg\",50,30,130,10,0.98"));
  EXPECT_THAT(csv, HasSubstr(",0.6,0,0.8\na.jpg,c.jpg,50,0,100,10,,,,,,,\n"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 4);
}

TEST_F(PairsCsv, DescriptionCountsWhatIsThere) {
  const std::string text = DescribeDatabase(database_);
  EXPECT_THAT(text, HasSubstr("images    3 (3 with features, 0 with depth)"));
  EXPECT_THAT(text, HasSubstr("pairs     3, 0 with too few matches"));
  EXPECT_THAT(text, HasSubstr("verified  1 (one_ac_depth 1)\n"));
  EXPECT_THAT(text, HasSubstr("cameras   1\n  1       PINHOLE, focal length guessed\n"));
}

}  // namespace
}  // namespace cairn
