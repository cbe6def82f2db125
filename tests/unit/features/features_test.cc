// Blobs and textures whose features are known beforehand.
#include "cairn/features/features.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "cairn/base/rng.h"
#include "cairn/math/decompositions.h"
#include "features/plane_memory.h"
#include "support/instruction_sets.h"
#include "support/test.h"

namespace cairn {
namespace {

struct Blob {
  Eigen::Vector2d center;  // pixels; the center of the top-left pixel is (0.5, 0.5)
  Eigen::Matrix2d covariance;
  double height = 100;
};

Bitmap Draw(int width, int height, const std::vector<Blob>& blobs) {
  std::vector<double> values(static_cast<size_t>(width) * height, 60);
  for (const Blob& blob : blobs) {  // (in plain numbers, for builds that are not optimized)
    const Eigen::Matrix2d information = blob.covariance.inverse();
    const double xx = information(0, 0), xy = information(0, 1), yy = information(1, 1);
    const double center_x = blob.center.x(), center_y = blob.center.y();
    double* value = values.data();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double dx = x + 0.5 - center_x, dy = y + 0.5 - center_y;
        const double distance = xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy;
        if (distance < 100) *value += blob.height * std::exp(-0.5 * distance);
        ++value;
      }
    }
  }
  Bitmap bitmap{width, height, 1, {}};
  for (const double value : values) {
    bitmap.data.push_back(static_cast<uint8_t>(std::clamp(std::lround(value), 0L, 255L)));
  }
  return bitmap;
}

std::vector<Blob> GridOfBlobs(double sigma, Rng& rng) {
  std::vector<Blob> blobs;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      blobs.push_back({{60.0 * column + 50 + rng.Uniform(), 60.0 * row + 50 + rng.Uniform()},
                       sigma * sigma * Eigen::Matrix2d::Identity()});
    }
  }
  return blobs;
}

// Blobs of many sizes, bright and dark, that overlap.
std::vector<Blob> RandomBlobs(int size, uint64_t seed) {
  Rng rng(seed);
  std::vector<Blob> blobs;
  for (int k = 0; k < 150; ++k) {
    const double sigma = rng.Uniform(1.5, 6);
    blobs.push_back({{rng.Uniform(0, size), rng.Uniform(0, size)},
                     sigma * sigma * Eigen::Matrix2d::Identity(),
                     rng.Uniform(-50, 90)});
  }
  return blobs;
}

// The keypoint nearest to a position; null: there is none.
const Keypoint* Nearest(const Features& features, const Eigen::Vector2d& position) {
  const Keypoint* nearest = nullptr;
  for (const Keypoint& keypoint : features.keypoints) {
    if (!nearest ||
        (keypoint.Position() - position).norm() < (nearest->Position() - position).norm()) {
      nearest = &keypoint;
    }
  }
  return nearest;
}

struct Kind {
  FeatureType type;
  int first_octave;
};

class FeaturesOfKind : public testing::TestWithParam<Kind> {
 protected:
  FeatureOptions Options() const {
    FeatureOptions options;
    options.type = GetParam().type;
    options.first_octave = GetParam().first_octave;
    return options;
  }
};

TEST_P(FeaturesOfKind, LieOnTheBlobsAndHaveTheirSize) {
  Rng rng(1);
  for (const double sigma : {3.0, 5.0}) {
    const std::vector<Blob> blobs = GridOfBlobs(sigma, rng);
    const Features features = ExtractFeatures(Draw(280, 220, blobs), Options());
    Eigen::Vector2d bias = Eigen::Vector2d::Zero();
    for (const Blob& blob : blobs) {
      const Keypoint* keypoint = Nearest(features, blob.center);
      ASSERT_NE(keypoint, nullptr);
      const Eigen::Vector2d error = keypoint->Position() - blob.center;
      EXPECT_LT(error.norm(), 0.3);
      bias += error / static_cast<double>(blobs.size());
      const double scale = std::sqrt(std::abs(keypoint->Shape().determinant()));
      EXPECT_NEAR(scale / sigma, 1.0, 0.3);
    }
    EXPECT_LT(bias.norm(), 0.1) << bias.transpose();
  }
}

TEST_P(FeaturesOfKind, TellBrightBlobsFromDarkOnes) {
  Rng rng(9);
  std::vector<Blob> blobs = GridOfBlobs(4, rng);
  for (size_t k = 0; k < blobs.size(); k += 3) blobs[k].height = -50;
  const Features features = ExtractFeatures(Draw(280, 220, blobs), Options());
  ASSERT_EQ(features.polarities.size(), features.keypoints.size());
  for (size_t k = 0; k < blobs.size(); ++k) {
    const Keypoint* keypoint = Nearest(features, blobs[k].center);
    ASSERT_LT((keypoint->Position() - blobs[k].center).norm(), 1.0);
    EXPECT_EQ(features.polarities[keypoint - features.keypoints.data()], k % 3 == 0 ? 0 : 1);
  }
}

TEST_P(FeaturesOfKind, ComeAgainWhereTheImageIsTurned) {
  constexpr int kSize = 300;
  const std::vector<Blob> blobs = RandomBlobs(kSize, 2);
  std::vector<Blob> turned = blobs;  // by 90 degrees
  for (Blob& blob : turned) blob.center = {kSize - blob.center.y(), blob.center.x()};
  const Features first = ExtractFeatures(Draw(kSize, kSize, blobs), Options());
  const Features second = ExtractFeatures(Draw(kSize, kSize, turned), Options());
  ASSERT_GT(first.keypoints.size(), 60u);
  int num_again = 0, num_alike = 0;
  for (size_t i = 0; i < first.keypoints.size(); ++i) {
    const Keypoint& keypoint = first.keypoints[i];
    const Eigen::Vector2d there(kSize - keypoint.y, keypoint.x);
    int least = -1;
    for (size_t j = 0; j < second.keypoints.size(); ++j) {
      if ((second.keypoints[j].Position() - there).norm() > 1.0) continue;
      const int distance =
          (first.descriptors.row(i).cast<int>() - second.descriptors.row(j).cast<int>())
              .squaredNorm();
      if (least < 0 || distance < least) least = distance;
    }
    num_again += least >= 0;
    num_alike += least >= 0 && least < 150 * 150;  // of descriptors of norm 512
  }
  EXPECT_GT(num_again, 0.9 * static_cast<double>(first.keypoints.size()));
  EXPECT_GT(num_alike, 0.6 * static_cast<double>(first.keypoints.size()));
}

TEST_P(FeaturesOfKind, AreTheSameEveryTimeAndNoneWithoutTexture) {
  Rng rng(3);
  const Bitmap bitmap = Draw(280, 220, GridOfBlobs(4, rng));
  const Features features = ExtractFeatures(bitmap, Options());
  EXPECT_EQ(ExtractFeatures(bitmap, Options()).keypoints, features.keypoints);
  EXPECT_EQ(features.descriptors.rows(), static_cast<Eigen::Index>(features.keypoints.size()));
  FeatureOptions few = Options();
  few.max_num_features = 5;
  const Features largest = ExtractFeatures(bitmap, few);
  ASSERT_EQ(largest.keypoints.size(), 5u);
  EXPECT_TRUE(ExtractFeatures(Draw(100, 100, {}), Options()).keypoints.empty());
}

TEST_P(FeaturesOfKind, EachLimitLeavesSomeOut) {
  const Bitmap bitmap = Draw(300, 300, RandomBlobs(300, 2));
  const size_t num_all = ExtractFeatures(bitmap, Options()).keypoints.size();
  const auto expect_fewer = [&](auto change) {
    FeatureOptions options = Options();
    change(options);
    const size_t num = ExtractFeatures(bitmap, options).keypoints.size();
    EXPECT_GT(num, 10u);
    EXPECT_LT(num, num_all) << DumpOptions(options);
  };
  expect_fewer([](FeatureOptions& options) { options.edge_threshold = 1.5; });
  expect_fewer([](FeatureOptions& options) { options.max_num_orientations = 1; });
  expect_fewer(
      [](FeatureOptions& options) { options.min_peak_threshold = options.peak_threshold; });
}

// Sizes that are no multiples of a vector, an octave that is needed for the last features only.
TEST_P(FeaturesOfKind, DoNotDependOnTheInstructionSet) {
  Rng rng(4);
  const Bitmap bitmap = Draw(283, 221, GridOfBlobs(2, rng));
  const Features expected = ExtractFeatures(bitmap, Options());
  EXPECT_GT(expected.keypoints.size(), 10u);
  ForEachInstructionSet([&] {
    const Features features = ExtractFeatures(bitmap, Options());
    EXPECT_EQ(features.keypoints, expected.keypoints);
    EXPECT_EQ(features.descriptors, expected.descriptors);
  });
}

// Images of several sizes one after the other, large enough for pages that are used again.
TEST_P(FeaturesOfKind, DoNotDependOnImagesBefore) {
  Rng rng(4);
  const std::vector<Blob> blobs = GridOfBlobs(2, rng);
  const std::vector<Bitmap> bitmaps = {Draw(1000, 600, blobs), Draw(700, 500, blobs),
                                       Draw(1000, 600, GridOfBlobs(3, rng))};
  std::vector<Features> expected;
  for (const Bitmap& bitmap : bitmaps) expected.push_back(ExtractFeatures(bitmap, Options()));
  const PlaneReuse reuse;
  for (const size_t i : {0, 1, 2, 0, 2, 1}) {
    const Features features = ExtractFeatures(bitmaps[i], Options());
    EXPECT_EQ(features.keypoints, expected[i].keypoints);
    EXPECT_EQ(features.descriptors, expected[i].descriptors);
  }
}

// Fewer features are the first of more, which are the larger.
TEST_P(FeaturesOfKind, FewAreTheLargest) {
  Rng rng(5);
  std::vector<Blob> blobs = GridOfBlobs(3, rng);
  blobs[5].covariance *= 9;
  const Bitmap bitmap = Draw(280, 220, blobs);
  FeatureOptions options = Options();
  options.min_num_extrema = 0;  // without the shades between the blobs
  const Features all = ExtractFeatures(bitmap, options);
  for (const int number : {1, 4, 9}) {
    options.max_num_features = number;
    const Features few = ExtractFeatures(bitmap, options);
    ASSERT_EQ(few.keypoints.size(), static_cast<size_t>(number));
    EXPECT_TRUE(std::equal(few.keypoints.begin(), few.keypoints.end(), all.keypoints.begin()));
    EXPECT_EQ(few.descriptors, all.descriptors.topRows(number));
  }
  EXPECT_LT((all.keypoints[0].Position() - blobs[5].center).norm(), 1.0);
}

// Which of the blobs have a feature.
std::vector<bool> Found(const Features& features, const std::vector<Blob>& blobs) {
  std::vector<bool> found;
  for (const Blob& blob : blobs) {
    const Keypoint* nearest = Nearest(features, blob.center);
    found.push_back(nearest != nullptr && (nearest->Position() - blob.center).norm() < 1.0);
  }
  return found;
}

// In a faint image, what reaches a third of the usual threshold are features; the strongest first.
TEST_P(FeaturesOfKind, FaintOnesCountWhereThereAreFew) {
  Rng rng(6);
  std::vector<Blob> blobs = GridOfBlobs(4, rng);
  for (size_t k = 0; k < blobs.size(); ++k) blobs[k].height = k < 4 ? 30 : k < 8 ? 11 : 8;
  const Bitmap bitmap = Draw(280, 220, blobs);
  FeatureOptions options = Options();
  const auto first = [&](size_t number) {
    std::vector<bool> found(blobs.size(), false);
    std::fill_n(found.begin(), number, true);
    return found;
  };
  EXPECT_EQ(Found(ExtractFeatures(bitmap, options), blobs), first(12));
  for (const int number : {0, 4, 8}) {
    options.min_num_extrema = number;
    EXPECT_EQ(Found(ExtractFeatures(bitmap, options), blobs), first(std::max(4, number)));
  }
}

TEST_P(FeaturesOfKind, NoiseOfAGrayLevelHasNone) {
  Rng rng(7);
  Bitmap bitmap = Draw(280, 220, {});
  for (uint8_t& value : bitmap.data) {
    value = static_cast<uint8_t>(std::lround(value + rng.Gaussian()));
  }
  EXPECT_LT(ExtractFeatures(bitmap, Options()).keypoints.size(), 10u);
}

// A mask hides texture: what it leaves has few.
TEST_P(FeaturesOfKind, WhatIsMaskedDoesNotCountAsTexture) {
  Rng rng(8);
  std::vector<Blob> blobs = GridOfBlobs(4, rng);
  for (size_t k = 8; k < blobs.size(); ++k) blobs[k].height = 8;  // the last row
  const Bitmap bitmap = Draw(280, 220, blobs);
  FeatureOptions options = Options();
  options.min_num_extrema = 8;
  Bitmap mask = Draw(280, 220, {});
  std::fill_n(mask.data.begin(), 280 * 140, uint8_t{0});
  const std::vector<bool> without = Found(ExtractFeatures(bitmap, options), blobs);
  const std::vector<bool> with = Found(ExtractFeatures(bitmap, options, &mask), blobs);
  for (size_t k = 0; k < blobs.size(); ++k) {
    EXPECT_EQ(without[k], k < 8);
    EXPECT_EQ(with[k], k >= 8);
  }
}

INSTANTIATE_TEST_SUITE_P(Features, FeaturesOfKind,
                         testing::Values(Kind{FeatureType::kAffineDog, -1},
                                         Kind{FeatureType::kAffineDog, 0},
                                         Kind{FeatureType::kSift, -1}, Kind{FeatureType::kSift, 0}),
                         [](const auto& info) {
                           return std::string(NameOf(kFeatureTypes, info.param.type)) +
                                  (info.param.first_octave < 0 ? "_doubled" : "_full");
                         });

// The frame of a stretched blob is stretched along with it, though less: the window in which
// gradients are summed up is finite.
TEST(AffineDog, FramesFollowTheShape) {
  for (const double angle : {0.0, 0.5, 1.2}) {
    const Eigen::Matrix2d R = Eigen::Rotation2Dd(angle).toRotationMatrix();
    const Eigen::Matrix2d covariance = R * Eigen::Vector2d(49, 16).asDiagonal() * R.transpose();
    const Features features =
        ExtractFeatures(Draw(200, 200, {{{100.3, 99.6}, covariance}}), FeatureOptions());
    const Keypoint* keypoint = Nearest(features, {100.3, 99.6});
    ASSERT_NE(keypoint, nullptr);
    EXPECT_LT((keypoint->Position() - Eigen::Vector2d(100.3, 99.6)).norm(), 0.5);
    const Eigen::Matrix2d shape = keypoint->Shape() * keypoint->Shape().transpose();
    const auto [axes, directions] = SymmetricEigen(shape);
    const double ratio = std::sqrt(axes[1] / axes[0]);
    EXPECT_GT(ratio, 1.3);
    EXPECT_LT(ratio, 7.0 / 4 + 0.1);
    EXPECT_GT(std::abs(directions.col(1).dot(R.col(0))), std::cos(0.1)) << angle;
  }
}

// A slope that is brightest on the right: all gradients point along x, so that the frame stays as
// it is, and SIFT's bin of angle 0 has everything.
TEST(AffineDog, DescriptorsHaveColmapsOrder) {
  for (const double angle_deg : {0.0, 45.0, 90.0}) {
    const double angle = angle_deg * std::numbers::pi / 180;
    Bitmap bitmap = Draw(120, 120, {{{60.5, 60.5}, 16 * Eigen::Matrix2d::Identity(), 40}});
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 120; ++x) {
        // y points down; Lowe's angles grow from the first axis against the second one.
        const double along = (x - 60) * std::cos(angle) - (y - 60) * std::sin(angle);
        *bitmap.Pixel(x, y) = static_cast<uint8_t>(*bitmap.Pixel(x, y) + 45 + 0.7 * along);
      }
    }
    FeatureOptions options;
    options.type = FeatureType::kSift;
    options.estimate_upright = true;
    const Features features = ExtractFeatures(bitmap, options);
    const Keypoint* keypoint = Nearest(features, {60.5, 60.5});
    ASSERT_NE(keypoint, nullptr);
    const auto row = features.descriptors.row(keypoint - features.keypoints.data());
    const auto bin = static_cast<int>(angle_deg / 45);
    for (const int corner : {0, 3, 12, 15}) {  // cells away from the blob
      Eigen::Index strongest = 0;
      row.segment(8 * corner, 8).maxCoeff(&strongest);
      EXPECT_EQ(strongest, bin) << "cell " << corner;
    }
  }
}

}  // namespace
}  // namespace cairn
