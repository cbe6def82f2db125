// Depth of photographs by a network.
#include <algorithm>
#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/depth/depth_network.h"
#include "cairn/depth/sample_depth.h"
#include "support/shared_data.h"
#include "support/thrown_message.h"
#include "unit/pipeline/wall_fixture.h"

namespace cairn {
namespace {

class DepthModelTest : public WallTest {
 protected:
  DepthModelTest() : WallTest(3, 8, false) {}
  void SetUp() override {
    if (!std::filesystem::exists(model_)) GTEST_SKIP() << model_ << " is absent";
  }
  int64_t NumComputed(const BuildPipelineReport& report) const {
    for (const auto& [name, value] : report.run.stages.back().values) {
      if (name == "computed") return static_cast<int64_t>(value);
    }
    return -1;
  }
  const std::string model_ = SharedDataPath("models/fastdepth_7.onnx");
};

TEST_F(DepthModelTest, EachPhotographGetsItsDepthOnce) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.depth_path = "";
  options.inputs.depth_model = model_;
  options.inputs.stop_after = BuildStage::kDepth;
  const BuildPipelineReport report = RunBuildPipeline(options, {.num_threads = 2});
  EXPECT_EQ(report.summary.num_images_with_depth, 3);
  EXPECT_EQ(NumComputed(report), 3);
  {
    const Database database(folder_ / "a.db", Database::Mode::kReadOnly);
    for (const Image& image : database.ReadImages()) {
      const Bitmap photo = ReadBitmap(Images() + "/" + image.name, BitmapColor::kRgb);
      const auto expected = SampleDepth(DepthNetwork(model_, {}).Compute(photo), photo.width,
                                        photo.height, *database.ReadKeypoints(image.image_id), {});
      const auto samples = database.ReadDepthSamples(image.image_id);
      ASSERT_TRUE(samples.has_value()) << image.name;
      ASSERT_FALSE(samples->empty()) << image.name;
      EXPECT_TRUE(
          std::ranges::equal(*samples, expected, {}, &DepthSample::depth, &DepthSample::depth))
          << image.name;
    }
  }
  const std::string dump = Dump("a.db");
  EXPECT_EQ(NumComputed(RunBuildPipeline(options)), 0);
  EXPECT_TRUE(Dump("a.db") == dump);
}

// Before anything else is computed.
TEST_F(DepthModelTest, ASizeThatTheNetworkDoesNotTakeIsAnError) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.depth_path = "";
  options.inputs.depth_model = model_;
  options.depth.input_size = 230;
  EXPECT_THAT(ThrownMessage<IoError>([&] { RunBuildPipeline(options); }),
              HasSubstr("does not run on a 230 px input"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.db"));
}

}  // namespace
}  // namespace cairn
