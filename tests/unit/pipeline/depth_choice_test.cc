#include "pipeline/depth_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/pipeline/pair_scheduler.h"

namespace cairn {
namespace {

using ::testing::HasSubstr;

constexpr int kNumSamples = 60;
constexpr int kNumScales = 3;

// Evidence of a pair in which a hypothesis is right with a chance for each image and its reading.
PairDepthEvidence MakeEvidence(const std::vector<double>& chance1,
                               const std::vector<double>& chance2, double shift1 = 0.0,
                               double shift2 = 0.0) {
  DepthEvidence evidence;
  evidence.num_readings1 = evidence.num_readings2 = 2 * kNumScales;
  evidence.num_samples = kNumSamples;
  if (shift1 != 0.0) evidence.shift1 = {shift1, 0.01};
  if (shift2 != 0.0) evidence.shift2 = {shift2, 0.01};
  for (const double a : chance1) {
    for (const double b : chance2) {
      evidence.num_right.push_back(static_cast<int>(a * b * kNumSamples));
    }
  }
  return {evidence, 2 * kNumSamples};
}

const std::vector<double> kFineIsBest = {0.3, 0.9, 0.2, 0.3, 0.9, 0.2};
const std::vector<double> kCoarseIsBest = {0.3, 0.1, 0.9, 0.3, 0.1, 0.9};
const std::vector<double> kAlike = {0.8, 0.7, 0.85, 0.83, 0.7, 0.84};
const std::vector<double> kAlikeToo = {0.8, 0.7, 0.77, 0.78, 0.7, 0.79};
const std::vector<double> kShiftHarms = {0.8, 0.4, 0.5, 0.4, 0.3, 0.4};
const std::vector<double> kShiftHelps = {0.2, 0.1, 0.3, 0.8, 0.4, 0.5};

image_pair_t Pair(image_t a, image_t b) { return ImagePairToPairId(a, b); }

// All pairs of images that are alike.
std::map<image_pair_t, PairDepthEvidence> AllPairs(int num_images,
                                                   const std::vector<double>& chance,
                                                   double shift = 0.0) {
  std::map<image_pair_t, PairDepthEvidence> evidence;
  for (int i = 1; i <= num_images; ++i) {
    for (int j = i + 1; j <= num_images; ++j) {
      evidence[Pair(i, j)] = MakeEvidence(chance, chance, shift, shift);
    }
  }
  return evidence;
}

TEST(ChooseDepth, TakesTheScaleWithTheMostRightHypotheses) {
  for (const auto& [chance, scale] : {std::pair(kFineIsBest, 1), {kCoarseIsBest, 2}}) {
    const auto chosen = ChooseDepth(AllPairs(4, chance), {});
    ASSERT_EQ(chosen.size(), 4u);
    for (const auto& [id, depth] : chosen) {
      EXPECT_EQ(depth.scale, scale);
      EXPECT_EQ(depth.shift, 0.0);
      EXPECT_EQ(depth.num_hypotheses, 3 * 2 * kNumSamples);
      EXPECT_EQ(depth.num_right, 3 * static_cast<int>(0.81 * kNumSamples));
    }
  }
}

TEST(ChooseDepth, EachImageHasItsOwnScale) {
  std::map<image_pair_t, PairDepthEvidence> evidence;
  for (int i = 1; i <= 6; ++i) {
    for (int j = i + 1; j <= 6; ++j) {
      evidence[Pair(i, j)] =
          MakeEvidence(i % 2 ? kFineIsBest : kCoarseIsBest, j % 2 ? kFineIsBest : kCoarseIsBest);
    }
  }
  for (const auto& [id, depth] : ChooseDepth(evidence, {})) EXPECT_EQ(depth.scale, id % 2 ? 1 : 2);
}

TEST(ChooseDepth, AGainThatMayBeChanceChangesNothing) {
  auto evidence = AllPairs(4, kAlike);
  for (const auto pair : {Pair(1, 2), Pair(3, 4)}) {
    evidence[pair] = MakeEvidence(kAlikeToo, kAlikeToo);
  }
  const auto chosen = ChooseDepth(evidence, {});
  ASSERT_EQ(chosen.size(), 4u);
  for (const auto& [id, depth] : chosen) {
    EXPECT_EQ(depth.scale, 0);
    EXPECT_EQ(depth.shift, 0.0);
  }
}

TEST(ChooseDepth, ASmallGainOfEveryPairIsNoChance) {
  const auto chosen = ChooseDepth(AllPairs(4, kAlike), {});
  ASSERT_EQ(chosen.size(), 4u);
  for (const auto& [id, depth] : chosen) EXPECT_EQ(depth.scale, 2);
}

TEST(ChooseDepth, TooLittleEvidenceTeachesNothing) {
  EXPECT_TRUE(ChooseDepth({}, {}).empty());
  EXPECT_TRUE(ChooseDepth({{Pair(1, 2), MakeEvidence(kFineIsBest, kFineIsBest)}}, {}).empty());
  auto evidence = AllPairs(4, kFineIsBest);
  for (auto& [pair, e] : evidence) e.evidence.num_samples = 16;  // 48 an image
  EXPECT_TRUE(ChooseDepth(evidence, {}).empty());
}

TEST(ChooseDepth, TheShiftIsTheWeightedMedianWhereItHelps) {
  auto evidence = AllPairs(5, kShiftHelps, 0.2);
  evidence[Pair(1, 2)].evidence.shift1 = {7.0, 0.01};   // a pair that errs
  evidence[Pair(1, 3)].evidence.shift1 = {0.3, 0.001};  // one that weighs more than the others
  for (const auto& [id, depth] : ChooseDepth(evidence, {})) {
    EXPECT_EQ(depth.scale, 0);
    EXPECT_EQ(depth.shift, id == 1 ? 0.3 : 0.2);
  }
}

TEST(ChooseDepth, AShiftThatIsNotSureOrDoesHarmIsNotTaken) {
  for (const auto& [id, depth] : ChooseDepth(AllPairs(5, kShiftHarms, 0.2), {})) {
    EXPECT_EQ(depth.shift, 0.0);
  }
  for (const auto& [id, depth] : ChooseDepth(AllPairs(5, kShiftHelps, 0.01), {})) {
    EXPECT_EQ(depth.shift, 0.0) << "a standard deviation, of five pairs";
  }
  auto evidence = AllPairs(5, kShiftHelps, 0.2);
  int k = 0;
  for (auto& [pair, e] : evidence) {
    e.evidence.shift1.value = e.evidence.shift2.value = 0.2 * (k++ % 4) - 0.3;
  }
  for (const auto& [id, depth] : ChooseDepth(evidence, {})) EXPECT_EQ(depth.shift, 0.0);
}

TEST(ChooseDepth, AShiftThatIsSureIsTakenWhereItDoesNoHarm) {
  for (const auto& [id, depth] : ChooseDepth(AllPairs(5, kCoarseIsBest, 0.2), {})) {
    EXPECT_EQ(depth.scale, 2);
    EXPECT_EQ(depth.shift, 0.2);
  }
}

TEST(ChooseDepth, AShiftNeedsTwoPairs) {
  auto evidence = AllPairs(3, kShiftHelps, 0.2);
  evidence[Pair(1, 2)].evidence.shift1 = {};
  const auto chosen = ChooseDepth(evidence, {});
  EXPECT_EQ(chosen.at(1).shift, 0.0);
  EXPECT_EQ(chosen.at(2).shift, 0.2);
}

TEST(ChooseDepth, WhatIsKnownStaysAndIsReckonedWith) {
  const auto evidence = AllPairs(4, kCoarseIsBest);
  const std::map<image_t, ImageDepth> known = {{2, {1, 0.0, 10, 10}}};
  const auto chosen = ChooseDepth(evidence, known);
  EXPECT_EQ(chosen.count(2), 0u);
  EXPECT_EQ(chosen.at(1).scale, 2);
  const auto num_right = [](double a, double b) { return static_cast<int>(a * b * kNumSamples); };
  EXPECT_EQ(chosen.at(1).num_right, 2 * num_right(0.9, 0.9) + num_right(0.9, 0.1));
}

TEST(LearnedDepthText, SaysHowManyOfEachKind) {
  const std::string text =
      LearnedDepthText({{1, {0, 0.0, 100, 30}}, {2, {2, 0.1, 100, 30}}, {3, {2, 0.0, 100000, 3}}});
  EXPECT_THAT(text, HasSubstr("3 images, 1 at scale 1, 2 at scale 3"));
  EXPECT_THAT(text, HasSubstr("1 with a shift"));
  EXPECT_THAT(text, HasSubstr("1 useless"));
}

}  // namespace
}  // namespace cairn
