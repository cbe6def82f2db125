#include "view_graph/symmetry.h"

#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/poses.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

constexpr image_t kNumImages = 20;

// A model of images turned at random; all pairs of neighbours are in use and agree with it.
struct FoldedModel {
  Reconstruction model;
  ViewGraph graph;

  explicit FoldedModel(uint64_t seed) {
    Rng rng(seed);
    for (image_t id = 1; id <= kNumImages; ++id) {
      graph.image_ids.push_back(id);
      const Eigen::Vector2d tilt = 3 * UniformVector({{-1, 1}, {-1, 1}}, rng);
      model.images[id].cam_from_world =
          Rigid3d(ExpSO3({tilt.x(), tilt.y(), 0}), Eigen::Vector3d::Zero());
    }
    for (image_t id = 1; id < kNumImages; ++id) {
      AddPair(id, id + 1, Eigen::Quaterniond::Identity(), EdgeRemoval::kNone);
    }
  }

  // A pair that turns its second image by `turn` in the model's frame.
  void AddPair(image_t id1, image_t id2, const Eigen::Quaterniond& turn, EdgeRemoval removal,
               int num_inliers = 100) {
    ViewEdge edge;
    edge.image_id1 = id1;
    edge.image_id2 = id2;
    edge.num_inliers = num_inliers;
    edge.removal = removal;
    edge.cam2_from_cam1 =
        Rigid3d(Rotation(id2) * turn * Rotation(id1).conjugate(), Eigen::Vector3d::UnitX());
    graph.edges.push_back(edge);
  }
  // Seven of them, every second one turned back.
  void AddPairs(const Eigen::Quaterniond& turn, EdgeRemoval removal, int num_inliers = 100) {
    for (image_t id = 1; id <= 7; ++id) {
      AddPair(id, id + 10, id % 2 == 0 ? turn : turn.conjugate(), removal, num_inliers);
    }
  }

  Eigen::Quaterniond Rotation(image_t id) const {
    return model.images.at(id).cam_from_world.rotation;
  }
  Symmetry Find() const { return FindSymmetry(model, graph); }
};

Eigen::Quaterniond QuarterTurn() { return ExpSO3(Eigen::Vector3d(0, DegToRad(90), 0)); }

TEST(Symmetry, IsTheTurnThatContradictingPairsAgreeOn) {
  for (const EdgeRemoval removal :
       {EdgeRemoval::kRotationInconsistent, EdgeRemoval::kTripletInconsistent,
        EdgeRemoval::kModelInconsistent, EdgeRemoval::kAmbiguous}) {
    FoldedModel folded(1);
    EXPECT_EQ(folded.Find().num_pairs, 0);
    folded.AddPairs(QuarterTurn(), removal);
    const Symmetry symmetry = folded.Find();
    EXPECT_EQ(symmetry.num_pairs, 7);
    EXPECT_EQ(symmetry.num_active, 19);
    EXPECT_NEAR(symmetry.angle_deg, 90, 1e-9);
    EXPECT_EQ(symmetry.images,
              (std::vector<image_t>{1, 2, 3, 4, 5, 6, 7, 11, 12, 13, 14, 15, 16, 17}));
    EXPECT_TRUE(symmetry.IsFold());
  }
}

TEST(Symmetry, OfTwoTheOneOfMorePairsIsFound) {
  FoldedModel folded(2);
  for (image_t id = 1; id <= 4; ++id) {
    folded.AddPair(id, id + 8, ExpSO3({DegToRad(120), 0, 0}), EdgeRemoval::kTripletInconsistent);
  }
  EXPECT_NEAR(folded.Find().angle_deg, 120, 1e-9);
  EXPECT_FALSE(folded.Find().IsFold()) << "four pairs";
  folded.AddPairs(QuarterTurn(), EdgeRemoval::kTripletInconsistent);
  EXPECT_NEAR(folded.Find().angle_deg, 90, 1e-9);
  EXPECT_EQ(folded.Find().num_pairs, 7);
}

TEST(Symmetry, PairsOfOtherKindsHaveNoSay) {
  FoldedModel folded(3);
  for (const EdgeRemoval removal :
       {EdgeRemoval::kNone, EdgeRemoval::kTooFewInliers, EdgeRemoval::kNoPose,
        EdgeRemoval::kDirectionInconsistent, EdgeRemoval::kOtherComponent}) {
    folded.AddPairs(QuarterTurn(), removal);
  }
  folded.AddPairs(QuarterTurn(), EdgeRemoval::kAmbiguous, 29);             // inliers
  folded.AddPairs(ExpSO3({0, DegToRad(15), 0}), EdgeRemoval::kAmbiguous);  // an inexact pose
  ASSERT_EQ(folded.graph.edges.size(), 19u + 7 * 7);
  EXPECT_EQ(folded.Find().num_pairs, 0);
  EXPECT_TRUE(folded.Find().images.empty());
  // Of images that the model lacks, none either.
  folded.AddPairs(QuarterTurn(), EdgeRemoval::kAmbiguous);
  EXPECT_EQ(folded.Find().num_pairs, 7);
  for (image_t id = 11; id <= 17; ++id) folded.model.images.erase(id);
  EXPECT_EQ(folded.Find().num_pairs, 0);
}

TEST(Symmetry, WrongPairsThatDisagreeAreNone) {
  FoldedModel folded(4);
  Rng rng(4);
  for (image_t id1 = 1; id1 <= kNumImages; ++id1) {
    for (image_t id2 = id1 + 2; id2 <= std::min(kNumImages, id1 + 5); ++id2) {
      folded.AddPair(id1, id2, RandomRotation(rng), EdgeRemoval::kRotationInconsistent);
    }
  }
  ASSERT_GT(folded.graph.edges.size(), 80u);
  EXPECT_LE(folded.Find().num_pairs, 3);
  EXPECT_FALSE(folded.Find().IsFold());
}

TEST(Symmetry, DoesNotDependOnTheFrameOfTheModel) {
  FoldedModel folded(5);
  folded.AddPairs(QuarterTurn(), EdgeRemoval::kModelInconsistent);
  for (auto& [id, image] : folded.model.images) {
    image.cam_from_world.rotation = image.cam_from_world.rotation * ExpSO3({0.4, -1.1, 2.0});
  }
  const Symmetry symmetry = folded.Find();
  EXPECT_EQ(symmetry.num_pairs, 7);
  EXPECT_NEAR(symmetry.angle_deg, 90, 1e-9);
}

}  // namespace
}  // namespace cairn
