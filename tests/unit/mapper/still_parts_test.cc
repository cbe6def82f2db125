// Turntables in front of a background that stays, and marks over photographs.
#include <algorithm>

#include "cairn/base/rng.h"
#include "reconstruct_fixture.h"
#include "support/test.h"

namespace cairn {
namespace {

constexpr int kNumMarks = 15;

// Ten photographs of a scene; the first num_marked of them show marks at the same pixels, which
// were matched, and verification rejected.
// Pairs with a last image from `first_of_round` on and a first one before it have no marks.
Database MakeMarkedDatabase(int num_marked, size_t num_marks = kNumMarks,
                            image_t first_of_round = 100) {
  const SyntheticScene scene = MakeScene(SmallScene(), 3);
  Database database = MakeDatabase(scene);
  Rng rng(1);
  std::vector<Keypoint> marks(num_marks);
  for (Keypoint& mark : marks) {
    mark.x = static_cast<float>(rng.Uniform(20, 600));
    mark.y = static_cast<float>(rng.Uniform(20, 440));
  }
  for (image_t id = 1; id <= static_cast<image_t>(num_marked); ++id) {
    std::vector<Keypoint> keypoints = scene.keypoints.at(id);
    for (Keypoint mark : marks) {
      mark.x += static_cast<float>(0.2 * rng.Gaussian());
      mark.y += static_cast<float>(0.2 * rng.Gaussian());
      keypoints.push_back(mark);
    }
    database.WriteKeypoints(id, keypoints);
  }
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    if (id2 > static_cast<image_t>(num_marked)) continue;
    if (id1 < first_of_round && id2 >= first_of_round) continue;
    FeatureMatches matches = database.ReadMatches(pair_id).value();
    for (size_t k = 0; k < num_marks; ++k) {
      matches.push_back({static_cast<point2D_t>(scene.keypoints.at(id1).size() + k),
                         static_cast<point2D_t>(scene.keypoints.at(id2).size() + k)});
    }
    database.WriteMatches(pair_id, matches);
  }
  return database;
}

std::string Warnings(const ReconstructResult& result) {
  std::string text;
  for (const ResultWarning& warning : result.report.warnings) {
    text += warning.what + " " + warning.advice + "\n";
  }
  return text;
}

TEST(StillParts, AreNamedWithTheWayOut) {
  const ReconstructResult result = Reconstruct(MakeMarkedDatabase(10));
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(result.models[0].images.size(), 10u);
  EXPECT_THAT(Warnings(result), AllOf(HasSubstr("while others move, in 10 of 10 photos"),
                                      HasSubstr("(15 matches of "), HasSubstr("--mask_path")));
}

TEST(StillParts, OfFewPhotographsAreNot) {
  EXPECT_EQ(Warnings(Reconstruct(MakeMarkedDatabase(0))), "");
  EXPECT_EQ(Warnings(Reconstruct(MakeMarkedDatabase(4))), "");
}

// Two turns of a turntable: at the same angle all moves alike, and such pairs share the most.
TEST(StillParts, OfTwoTurnsAreSeenWithinEach) {
  constexpr image_t kSecondTurn = 6;
  Database database = MakeMarkedDatabase(10, kNumMarks, kSecondTurn);
  ChangeGeometries(database, [](image_t id1, image_t id2, TwoViewGeometry& geometry) {
    if (id1 < kSecondTurn && id2 >= kSecondTurn) return;
    geometry.inlier_matches.resize(geometry.inlier_matches.size() / 3);
  });
  EXPECT_THAT(Warnings(Reconstruct(database)), HasSubstr("while others move, in 10 of 10 photos"));
}

// Though all that a pair rejects is still.
TEST(StillParts, OneMatchOfAPairIsNone) {
  Database database = MakeMarkedDatabase(10, 1);
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    FeatureMatches matches = database.ReadTwoViewGeometry(pair_id)->inlier_matches;
    matches.push_back({static_cast<point2D_t>(*database.ReadNumKeypoints(id1) - 1),
                       static_cast<point2D_t>(*database.ReadNumKeypoints(id2) - 1)});
    database.WriteMatches(pair_id, matches);
  }
  EXPECT_EQ(Warnings(Reconstruct(database)), "");
}

// As photographs of a video against the next ones: others show that the camera moves.
TEST(StillParts, PairsAloneAreNot) {
  Database database = MakeMarkedDatabase(0);
  for (image_t id = 1; id < 10; ++id) {
    const image_pair_t pair_id = ImagePairToPairId(id, id + 1);
    auto geometry = database.ReadTwoViewGeometry(pair_id);
    if (!geometry) continue;
    geometry->config = TwoViewConfig::kPanoramic;
    geometry->cam2_from_cam1 = Rigid3d();
    database.WriteTwoViewGeometry(pair_id, *geometry);
  }
  EXPECT_EQ(Warnings(Reconstruct(database)), "");
}

// The background has more matches than the object: verification finds that nothing moves.
TEST(StillParts, ThatOutweighTheObjectAreTheReasonForTheFailure) {
  Database database = MakeMarkedDatabase(10);
  ChangeGeometries(database, [&](image_t id1, image_t id2, TwoViewGeometry& geometry) {
    const image_pair_t pair_id = ImagePairToPairId(id1, id2);
    geometry.config = TwoViewConfig::kPanoramic;
    geometry.cam2_from_cam1 = Rigid3d();
    geometry.inlier_matches = database.ReadMatches(pair_id).value();
    geometry.inlier_matches.erase(geometry.inlier_matches.begin(),
                                  geometry.inlier_matches.end() - kNumMarks);  // the marks
    WriteWinner(pair_id, "test", database);
  });
  const ReconstructResult result = Reconstruct(database);
  EXPECT_TRUE(result.models.empty());
  EXPECT_THAT(result.report.failure, AllOf(HasSubstr("no_pose"), HasSubstr("--mask_path")));
  EXPECT_THAT(Warnings(result), HasSubstr("stays still in the picture (10 of 10 photos)"));
}

}  // namespace
}  // namespace cairn
