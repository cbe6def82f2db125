#include "cairn/depth/depth_network.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include "cairn/base/error.h"
#include "cairn/depth/sample_depth.h"
#include "support/shared_data.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

class DepthNetworkTest : public ::testing::Test {
 protected:
  void SetUp() override {
    model_ = SharedDataPath("models/fastdepth_7.onnx");
    photo_ = SharedDataPath("strecha/fountain-P11/images/0000.jpg");
    if (!std::filesystem::exists(model_)) GTEST_SKIP() << model_ << " is absent";
    if (!std::filesystem::exists(photo_)) GTEST_SKIP() << photo_ << " is absent";
  }
  std::string model_, photo_;
};

double MeanDepth(const DepthMap& map) {
  double sum = 0;
  for (const float depth : map.values) sum += depth;
  return sum / map.NumValid();
}

TEST_F(DepthNetworkTest, FastDepthGivesAPlausibleMap) {
  const Bitmap photo = ReadBitmap(photo_, BitmapColor::kRgb);
  DepthNetwork network(model_, {});
  const DepthMap map = network.Compute(photo);
  EXPECT_EQ(map.width, 224);
  EXPECT_EQ(map.height, 224);
  EXPECT_EQ(map.NumValid(), 224 * 224);
  EXPECT_GT(MeanDepth(map), 0.5);
  EXPECT_LT(MeanDepth(map), 10.0);
  EXPECT_EQ(network.Compute(photo).values, map.values);  // Again, the same bytes.

  const std::vector<Keypoint> keypoints = {{.x = 700.f, .y = 500.f}};
  EXPECT_TRUE(SampleDepth(map, photo.width, photo.height, keypoints, {})[0].is_valid);
}

TEST_F(DepthNetworkTest, EachInputOptionChangesTheMap) {
  const Bitmap photo = ReadBitmap(photo_, BitmapColor::kRgb);
  const DepthMap reference = DepthNetwork(model_, {}).Compute(photo);
  DepthOptions options;
  options.mean = {0.3, 0.3, 0.3};
  EXPECT_NE(DepthNetwork(model_, options).Compute(photo).values, reference.values);
  options = {};
  options.std = {0.5, 0.5, 0.5};
  EXPECT_NE(DepthNetwork(model_, options).Compute(photo).values, reference.values);
  options = {};
  options.kind = DepthKind::kInverse;
  EXPECT_NE(DepthNetwork(model_, options).Compute(photo).is_inverse, reference.is_inverse);
}

TEST_F(DepthNetworkTest, ASizeThatTheNetworkRefusesIsAnError) {
  DepthOptions options;
  options.input_size = 225;
  DepthNetwork network(model_, options);
  EXPECT_THROW(network.Compute(ReadBitmap(photo_, BitmapColor::kRgb)), IoError);
}

TEST(DepthNetwork, BrokenModelsAndOptionsAreErrors) {
  EXPECT_THROW(DepthNetwork("/nowhere/net.onnx", {}), IoError);
  const TempFolder folder;
  const std::string path = folder / "broken.onnx";
  std::ofstream(path) << "this is no network";
  EXPECT_THROW(DepthNetwork(path, {}), IoError);
  DepthOptions options;
  options.mean = {0.5};
  EXPECT_THROW(DepthNetwork(path, options), ConfigError);
  options = {};
  options.std = {1, 0, 1};
  EXPECT_THROW(DepthNetwork(path, options), ConfigError);
}

}  // namespace
}  // namespace cairn
