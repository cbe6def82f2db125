#include "report_page/page_parts.h"

#include <algorithm>
#include <numeric>

#include "cairn/base/rng.h"
#include "support/test.h"

namespace cairn {
namespace {

// Test vectors of RFC 4648, section 10.
TEST(PageBlocks, Base64IsThatOfTheRfc) {
  for (const auto& [text, base64] : {std::pair("", ""),
                                     {"f", "Zg=="},
                                     {"fo", "Zm8="},
                                     {"foo", "Zm9v"},
                                     {"foob", "Zm9vYg=="},
                                     {"fooba", "Zm9vYmE="},
                                     {"foobar", "Zm9vYmFy"}}) {
    PageBlocks blocks;
    EXPECT_EQ(blocks.AddBytes(text), 0);
    EXPECT_THAT(blocks.Html(), HasSubstr(std::string("id=\"block0\">") + base64 + "<"));
  }
}

TEST(SpectralOrder, FindsAChainWhateverItsNodesAreCalled) {
  constexpr int kNum = 40;
  std::vector<int> name(kNum);
  std::iota(name.begin(), name.end(), 0);
  Rng rng(3);
  for (int i = kNum - 1; i > 0; --i) std::swap(name[i], name[rng.UniformInt(i + 1)]);
  std::vector<WeightedEdge> edges;
  for (int i = 0; i < kNum; ++i) {
    for (int step = 1; step <= 3 && i + step < kNum; ++step) {
      edges.push_back({name[i], name[i + step], 1.0 / step});
    }
  }
  std::vector<int> order = SpectralOrder(kNum, edges);
  if (order.front() != name.front()) std::reverse(order.begin(), order.end());
  EXPECT_EQ(order, name);
}

TEST(SpectralOrder, LargerComponentsFirstAndNodesWithoutEdgesLast) {
  const std::vector<int> order = SpectralOrder(6, {{1, 4, 1}, {0, 2, 1}, {2, 3, 1}});
  EXPECT_EQ(order.size(), 6u);
  EXPECT_THAT(
      (std::vector<int>{std::min(order[3], order[4]), std::max(order[3], order[4]), order[5]}),
      ElementsAre(1, 4, 5));
}

TEST(ResidualMap, HoldsTheMeanOfEachCell) {
  const Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, 500, 480, 360);
  ResidualMap map(480, 360);
  EXPECT_EQ(map.columns, 24);
  EXPECT_EQ(map.rows, 18);
  map.Add(camera, {0.5, 0.5}, {1, -2});
  map.Add(camera, {19.5, 19.5}, {3, 2});
  map.Add(camera, {479.5, 359.5}, {0, 1});
  map.Add(camera, {-1, 5}, {100, 100});  // beside the sensor
  map.Finish();
  EXPECT_FLOAT_EQ(map.count.front(), 2);
  EXPECT_FLOAT_EQ(map.dx.front(), 2);
  EXPECT_FLOAT_EQ(map.dy.front(), 0);
  EXPECT_FLOAT_EQ(map.rms.front(), 3);
  EXPECT_FLOAT_EQ(map.dy.back(), 1);
  EXPECT_FLOAT_EQ(std::accumulate(map.count.begin(), map.count.end(), 0.f), 3);
}

PageCamera CameraThatWas(double before_px, double after_px) {
  PageCamera camera;
  camera.known.camera = Camera::FromFocal(1, CameraModel::kSimpleRadial, before_px, 640, 480);
  camera.refined = Camera::FromFocal(1, CameraModel::kSimpleRadial, after_px, 640, 480);
  return camera;
}

TEST(DoubtAboutCamera, NamesWhatSpeaksAgainstIntrinsics) {
  PageCamera camera = CameraThatWas(500, 500);
  EXPECT_THAT(DoubtAboutCamera(camera), HasSubstr("guess that nothing confirmed"));
  camera.known.is_given = true;
  EXPECT_THAT(DoubtAboutCamera(camera), IsEmpty());

  camera = CameraThatWas(500, 550);
  EXPECT_THAT(DoubtAboutCamera(camera), IsEmpty());
  camera.known.camera.has_prior_focal_length = true;
  EXPECT_THAT(DoubtAboutCamera(camera), IsEmpty());
  camera.refined->SetMeanFocal(700);
  EXPECT_THAT(DoubtAboutCamera(camera), HasSubstr("700 px, where the photos came with 500 px"));

  camera.known.judgement = CameraFocal{true, 12, 9};
  EXPECT_THAT(DoubtAboutCamera(camera), HasSubstr("9 of 12 pairs contradict"));
}

TEST(WhyLeftOut, GivesTheFirstThingThatWasMissing) {
  PageImage image;
  const auto reason = [&] { return WhyLeftOut(image, true).what; };
  EXPECT_THAT(reason(), HasSubstr("no features"));
  EXPECT_THAT(WhyLeftOut(image, false).what, HasSubstr("no relative pose"));
  image.num_keypoints = 100;
  EXPECT_THAT(reason(), HasSubstr("no photo has matches"));
  image.num_matched = 5;
  EXPECT_THAT(reason(), HasSubstr("none of their pairs passed verification"));
  image.num_verified = 4;
  image.removals = {{"ambiguous", 3}, {"no_pose", 1}};
  EXPECT_THAT(reason(), HasSubstr("mostly: ambiguous"));
  EXPECT_THAT(WhyLeftOut(image, false).what, HasSubstr("mostly: ambiguous"));
  image.num_pairs = 1;
  EXPECT_THAT(reason(), HasSubstr("with each other only"));
  image.num_to_models = 1;
  EXPECT_THAT(reason(), HasSubstr("too few of their matches show points"));
}

}  // namespace
}  // namespace cairn
