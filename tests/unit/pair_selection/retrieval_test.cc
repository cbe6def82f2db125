#include "cairn/base/rng.h"
#include "cairn/pair_selection/pair_selection.h"
#include "support/test.h"

namespace cairn {
namespace {

constexpr int kNumImages = 24;
constexpr int kPerPlace = 40;

// A SIFT-like descriptor.
Eigen::Matrix<uint8_t, 1, 128> RandomDescriptor(Rng& rng) {
  Eigen::Matrix<uint8_t, 1, 128> descriptor;
  for (int k = 0; k < 128; ++k) {
    const double value = rng.Gaussian();
    descriptor(k) = static_cast<uint8_t>(std::min(255.0, 45 * value * value));
  }
  return descriptor;
}

// Images on a ring: image i sees the places i, i + 1, i + 2, each with kPerPlace points, whose
// descriptors differ a little from image to image.
std::vector<Descriptors> RingImages() {
  Rng rng(1);
  Descriptors points(kNumImages * kPerPlace, 128);
  for (int i = 0; i < points.rows(); ++i) points.row(i) = RandomDescriptor(rng);
  std::vector<Descriptors> images;
  for (int i = 0; i < kNumImages; ++i) {
    Descriptors& image = images.emplace_back(3 * kPerPlace, 128);
    for (int k = 0; k < image.rows(); ++k) {
      const int point = (i * kPerPlace + k) % static_cast<int>(points.rows());
      for (int c = 0; c < 128; ++c) {
        const double value = points(point, c) + 4 * rng.Gaussian();
        image(k, c) = static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
      }
    }
  }
  return images;
}

FloatRows SamplesOf(const std::vector<Descriptors>& images) {
  FloatRows samples(static_cast<Eigen::Index>(images.size()) * 60, 128);
  for (size_t i = 0; i < images.size(); ++i) {
    samples.middleRows(static_cast<Eigen::Index>(i) * 60, 60) = SampleDescriptors(images[i], 60);
  }
  return samples;
}

constexpr image_t kFirstId = 100;

DescribedImages Describe(const std::vector<Descriptors>& images, const FloatRows& words) {
  DescribedImages described;
  described.descriptions.resize(static_cast<Eigen::Index>(images.size()), words.size());
  for (size_t i = 0; i < images.size(); ++i) {
    described.ids.push_back(kFirstId + static_cast<image_t>(i));
    described.descriptions.row(static_cast<Eigen::Index>(i)) = DescribeImage(images[i], words);
  }
  return described;
}

Queries All(const DescribedImages& images) {
  Queries queries;
  for (const image_t id : images.ids) queries[id];
  return queries;
}

std::vector<std::vector<image_t>> SimilarToAll(const DescribedImages& images, int num,
                                               int num_threads) {
  return MostSimilar(images, All(images), num, num_threads);
}

TEST(Retrieval, ImagesThatShareMostComeFirst) {
  const std::vector<Descriptors> images = RingImages();
  const DescribedImages described = Describe(images, TrainWords(SamplesOf(images), 16, 2));
  const auto similar = SimilarToAll(described, 4, 2);
  for (int i = 0; i < kNumImages; ++i) {
    const auto at = [&](int step) { return kFirstId + (i + step + kNumImages) % kNumImages; };
    EXPECT_NEAR(described.descriptions.row(i).norm(), 1, 1e-5);
    EXPECT_THAT(std::vector<image_t>(similar[i].begin(), similar[i].begin() + 2),
                UnorderedElementsAre(at(1), at(-1)));
    EXPECT_THAT(similar[i], UnorderedElementsAre(at(1), at(-1), at(2), at(-2)));
  }
  // Frames of one pass of a video hide those of another one, unless they are left out.
  const auto others = MostSimilar(described, {{7, {}}, {105, {{104, 106}}}}, 2, 1);
  ASSERT_EQ(others.size(), 1u);
  EXPECT_THAT(others[0], UnorderedElementsAre(103, 107));
  const auto part = std::make_shared<const std::vector<image_t>>(std::vector<image_t>{103, 105});
  const auto apart = MostSimilar(described, {{105, {{104, 106}, part}}}, 1, 1);
  EXPECT_THAT(apart.at(0), ElementsAre(107));
}

TEST(Retrieval, LargestFeaturesDecideTheOrder) {
  const std::vector<Descriptors> images = RingImages();
  DescribedImages described = Describe(images, TrainWords(SamplesOf(images), 16, 2));
  std::vector<Keypoint> keypoints(3 * kPerPlace);
  // The last place is seen with the largest features.
  for (int k = 0; k < 3 * kPerPlace; ++k) keypoints[k].a11 = static_cast<float>(1 + k / kPerPlace);
  for (int i = 0; i < kNumImages; ++i) {
    described.largest_features.push_back(LargestFeatures(keypoints, images[i], 2 * kPerPlace));
  }
  const Candidates candidates = FindCandidates(described, All(described), 6, 2);
  EXPECT_EQ(candidates.size(), described.ids.size());
  for (const auto& [id, of_image] : candidates) {
    ASSERT_EQ(of_image.size(), 6u);
    EXPECT_GE(of_image[1].num_matches, kPerPlace - 2) << id;  // one of two places
    EXPECT_LE(of_image[2].num_matches, 2) << id;
  }
  const auto pairs = RetrievalPairs(candidates, 2);
  EXPECT_EQ(pairs.size(), described.ids.size());  // the ring
  EXPECT_EQ(pairs[0], ImagePairToPairId(100, 101));
  EXPECT_EQ(pairs[1], ImagePairToPairId(100, 100 + kNumImages - 1));
  const Candidates of_one = FindCandidates(described, {{105, {{104}}}}, 6, 2);
  EXPECT_EQ(of_one.at(105).front(), (Candidate{106, candidates.at(106).at(0).num_matches}));
}

TEST(Retrieval, SameForAnyNumberOfThreads) {
  const std::vector<Descriptors> images = RingImages();
  const FloatRows samples = SamplesOf(images);
  const FloatRows words = TrainWords(samples, 16, 1);
  const auto similar = SimilarToAll(Describe(images, words), 5, 1);
  for (const int num_threads : {2, 8}) {
    EXPECT_EQ(TrainWords(samples, 16, num_threads), words);
    EXPECT_EQ(TrainWords(samples, 7, num_threads).rows(), 7);
    EXPECT_EQ(SimilarToAll(Describe(images, words), 5, num_threads), similar);
  }
}

// A facade of one window many times over: what else two photographs show must tell them apart.
TEST(Retrieval, ABurstOfOneFeatureDoesNotOutweighTheRest) {
  Rng rng(3);
  std::vector<Descriptors> images = RingImages();
  const FloatRows words = TrainWords(SamplesOf(images), 16, 1);
  const auto window = RandomDescriptor(rng);
  for (const int i : {0, 12}) {
    const Eigen::Index rows = images[i].rows();
    images[i].conservativeResize(3 * rows, 128);
    for (Eigen::Index k = rows; k < 3 * rows; ++k) images[i].row(k) = window;
  }
  const FloatRows descriptions = Describe(images, words).descriptions;
  EXPECT_GT(descriptions.row(0).dot(descriptions.row(1)),
            descriptions.row(0).dot(descriptions.row(12)));
}

TEST(Retrieval, FewerSamplesThanWordsAndImagesWithoutFeatures) {
  const FloatRows words = TrainWords(SampleDescriptors(RingImages()[0], 5), 16, 1);
  EXPECT_EQ(words.rows(), 5);
  EXPECT_EQ(DescribeImage(Descriptors(0, 128), words).norm(), 0);
  EXPECT_EQ(TrainWords(FloatRows(0, 128), 16, 1).rows(), 0);
  EXPECT_EQ(SimilarToAll({{1}, FloatRows::Zero(1, 5), {}}, 3, 1)[0].size(), 0u);
}

}  // namespace
}  // namespace cairn
