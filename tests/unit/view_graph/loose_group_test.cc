#include "view_graph/loose_group.h"

#include "cairn/base/rng.h"
#include "cairn/synthetic/scene.h"
#include "support/test.h"

namespace cairn {
namespace {

Reconstruction Arc(uint64_t seed) {
  SceneOptions options;
  options.layout = CameraLayout::kArc;
  options.num_images = 16;
  options.num_points = 1000;
  return MakeScene(options, seed).truth;
}

std::vector<image_pair_t> AllPairs(const Reconstruction& model) {
  std::vector<image_pair_t> pairs;
  for (const auto& [id1, image1] : model.images) {
    for (const auto& [id2, image2] : model.images) {
      if (id1 < id2) pairs.push_back(ImagePairToPairId(id1, id2));
    }
  }
  return pairs;
}

// Of the points, all but a share are matched among these images and among the others alone.
Reconstruction WithLoose(Reconstruction model, const std::set<image_t>& group, double share) {
  Rng rng(1);
  std::vector<Point3D> points;
  for (const auto& [id, point] : Reconstruction(model).points3D) {
    if (rng.Uniform(0, 1) < share) continue;
    Point3D of_group = point, of_others = point;
    std::erase_if(of_group.track, [&](const auto& e) { return !group.contains(e.image_id); });
    std::erase_if(of_others.track, [&](const auto& e) { return group.contains(e.image_id); });
    model.RemovePoint3D(id);
    for (const Point3D& part : {of_group, of_others}) {
      if (part.track.size() >= 2) model.AddPoint3D(part);
    }
  }
  return model;
}

const std::set<image_t> kGroup = {3, 5, 8, 11, 12};

TEST(LooseGroup, APlaceAloneHasNone) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Reconstruction model = Arc(seed);
    const LooseGroup found = FindLooseGroup(model, AllPairs(model));
    EXPECT_GT(found.relative_rate, 0.5) << seed;
    EXPECT_FALSE(found.IsLoose());
  }
}

TEST(LooseGroup, IsFoundWithTheRateAtWhichItMatches) {
  for (const uint64_t seed : {1, 2, 3}) {
    for (const double share : {0.05, 0.15}) {
      const Reconstruction model = WithLoose(Arc(seed), kGroup, share);
      const LooseGroup found = FindLooseGroup(model, AllPairs(model));
      EXPECT_EQ(found.images, kGroup) << seed;
      EXPECT_EQ(found.others.size(), 11u);
      // An image's point that none of its own group shares is gone.
      EXPECT_NEAR(found.relative_rate, share, 0.03);
      EXPECT_TRUE(found.IsLoose());
    }
  }
}

// Another light, say.
TEST(LooseGroup, WhatMatchesAThirdAsWellIsNotLoose) {
  const Reconstruction model = WithLoose(Arc(1), kGroup, 0.35);
  EXPECT_FALSE(FindLooseGroup(model, AllPairs(model)).IsLoose());
}

TEST(LooseGroup, PairsThatWereNotMatchedDoNotTell) {
  const Reconstruction model = WithLoose(Arc(1), kGroup, 0.05);
  std::vector<image_pair_t> tried = AllPairs(model);
  std::erase_if(tried, [](image_pair_t pair) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    return kGroup.contains(id1) != kGroup.contains(id2);
  });
  const LooseGroup found = FindLooseGroup(model, tried);
  EXPECT_TRUE(found.images.empty() || found.images != kGroup);
  EXPECT_FALSE(found.IsLoose());
}

TEST(LooseGroup, NeitherFrameNorThreadsMatter) {
  Reconstruction model = WithLoose(Arc(2), kGroup, 0.1);
  const LooseGroup found = FindLooseGroup(model, AllPairs(model), {.num_threads = 1});
  model.Transform(
      {3.0, Eigen::Quaterniond(0.5, -0.5, 0.1, 0.7).normalized(), Eigen::Vector3d(10, -20, 5)});
  const LooseGroup again = FindLooseGroup(model, AllPairs(model), {.num_threads = 4});
  EXPECT_EQ(again.images, found.images);
  EXPECT_EQ(again.others, found.others);
  EXPECT_DOUBLE_EQ(again.relative_rate, found.relative_rate);
}

TEST(LooseGroup, NothingHasNone) {
  EXPECT_FALSE(FindLooseGroup({}, {}).IsLoose());
  EXPECT_FALSE(FindLooseGroup(Arc(1), {}).IsLoose());
}

}  // namespace
}  // namespace cairn
