#include "cairn/report_page/report_page.h"

#include <limits>
#include <nlohmann/json.hpp>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/image/bitmap.h"
#include "cairn/synthetic/scene.h"
#include "support/database_dump.h"
#include "support/scene_view_graph.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

using Json = nlohmann::json;

// A database of eight images, of which the model has six.
class ReportPageTest : public ::testing::Test {
 protected:
  ReportPageTest() {
    SceneOptions options;
    options.num_images = 8;
    options.num_points = 300;
    options.max_keypoints = 200;
    options.outlier_ratio = 0.2;
    options.pair_metrics = true;
    const SyntheticScene scene = MakeScene(options, 1);
    WriteScene(scene, SceneContent::kTwoViewGeometries, database_);
    graph_ = MakeViewGraph(scene);
    models_.push_back(scene.truth);
    for (const image_t id : {7, 8}) Remove(id);
  }

  void Remove(image_t id) {
    Reconstruction& model = models_[0];
    const RegisteredImage image = model.images.at(id);
    for (point2D_t i = 0; i < image.points2D.size(); ++i) {
      const point3D_t point = model.images.at(id).point3D_ids[i];
      if (point != kInvalidPoint3DId) model.RemoveObservation(point, {id, i});
    }
    model.images.erase(id);
  }

  ReportPageInput Input() const {
    return {.title = "a & b",
            .image_path = "",
            .models = models_,
            .model_names = {"sparse/0"},
            .graph = graph_,
            .run_json = R"({"program": "p", "succeeded": true, "stages": []})",
            .build_json = ""};
  }
  static Json DataOf(const ReportPage& page) {
    const std::string begin = "id=\"data\">";
    const size_t at = page.html.find(begin) + begin.size();
    return Json::parse(page.html.substr(at, page.html.find("</script>", at) - at));
  }
  Json Data(const ReportPageInput& input) const { return DataOf(MakeReportPage(database_, input)); }

  TempFolder folder_;
  Database database_{folder_ / "scene.db"};
  ViewGraph graph_;
  std::vector<Reconstruction> models_;
};

// Of a database or a model from elsewhere: the page has the others, and the run its result.
TEST_F(ReportPageTest, ValuesThatAreNoNumbersEndNothing) {
  for (ViewEdge& edge : graph_.edges) edge.residual_px = std::numeric_limits<double>::infinity();
  for (auto& [id, camera] : models_[0].cameras) camera.params.back() = 1e308;
  EXPECT_EQ(Data(Input())["images"]["list"].size(), 8u);
}

TEST_F(ReportPageTest, SaysWhatBecameOfEveryImageAndPair) {
  const Json data = Data(Input());
  EXPECT_EQ(data["title"], "a & b");
  ASSERT_EQ(data["images"]["list"].size(), 8u);
  EXPECT_EQ(data["images"]["list"][0]["model"], 0);
  EXPECT_GT(data["images"]["list"][0]["points"], 50);
  EXPECT_EQ(data["images"]["list"][7]["model"], -1);
  EXPECT_THAT(data["images"]["list"][7]["reason"].get<std::string>(), HasSubstr("too few"));
  EXPECT_EQ(data["models"][0]["images"], 6);
  EXPECT_NEAR(data["models"][0]["explained"].get<double>(), 1.0, 1e-9) << "the truth explains all";
  EXPECT_EQ(data["pairs"]["total"], 16);
  EXPECT_EQ(data["pairs"]["counts"]["in_use"], graph_.NumActiveEdges());
  EXPECT_EQ(data["histograms"].size(), 4u) << data["histograms"].dump(1);
  EXPECT_TRUE(data["cameras"][0].contains("map"));
  bool names_left_out = false;
  for (const Json& finding : data["findings"]) {
    names_left_out |= finding["images"] == Json({6, 7});
  }
  EXPECT_TRUE(names_left_out) << data["findings"].dump(1);
}

TEST_F(ReportPageTest, RowsThatCannotBeReadAreEmpty) {
  for (const std::string table : {"matches", "two_view_geometries", "keypoints"}) {
    RunSql(database_.path(), "UPDATE " + table + " SET data = x'00'");
    EXPECT_EQ(Data(Input())["pairs"]["total"], 16) << table;
  }
}

TEST_F(ReportPageTest, ThreadsDoNotChangeAByte) {
  EXPECT_TRUE(MakeReportPage(database_, Input(), {.num_threads = 1}).html ==
              MakeReportPage(database_, Input(), {.num_threads = 8}).html);
}

TEST_F(ReportPageTest, NamesAreTextAndEndNoElement) {
  const std::string name = "</script><b>\xff\"&.jpg";
  Image image = database_.ReadImages()[0];
  image.name = name;
  database_.WriteImage(image);
  models_[0].images.at(image.image_id).image.name = name;
  ReportPageInput input = Input();
  input.title = "<script>alert(1)</script>";
  input.run_json =
      R"({"program": "p", "succeeded": false, "failure": "a: <!--<script>; </script>", "stages": []})";
  const ReportPage page = MakeReportPage(database_, input);
  EXPECT_THAT(page.html, Not(HasSubstr("</script><b>")));
  EXPECT_THAT(page.html, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page.html, Not(HasSubstr("<!--<script>")));
  const Json data = DataOf(page);
  EXPECT_EQ(data["images"]["list"][0]["name"], "</script><b>\ufffd\"&.jpg");
  EXPECT_EQ(data["findings"][0]["what"], "a: <!--<script>; </script>");
}

TEST_F(ReportPageTest, AFailedRunShowsWhy) {
  ReportPageInput input = Input();
  input.models = {};
  input.model_names = {};
  input.run_json =
      R"({"succeeded": false, "failure": "view_graph: nothing; lower it", "stages": []})";
  const Json data = Data(input);
  EXPECT_EQ(data["findings"][0]["level"], "wrong");
  EXPECT_EQ(data["findings"][0]["what"], "view_graph: nothing; lower it");
  EXPECT_TRUE(data["models"].empty());
}

TEST_F(ReportPageTest, WarningsOfTheRunComeFirstWithAdvice) {
  ReportPageInput input = Input();
  input.run_json = R"({"succeeded": true, "stages": [], "warnings":
      [{"level": "doubtful", "what": "first", "advice": "look"}, "text of an older version",
       {"level": "wrong", "what": "second", "advice": ""}]})";
  const Json findings = Data(input)["findings"];
  EXPECT_EQ(findings[0]["what"], "second");
  EXPECT_EQ(findings[0]["level"], "wrong");
  EXPECT_EQ(findings[1]["what"], "first");
  EXPECT_EQ(findings[1]["advice"], "look");
}

TEST_F(ReportPageTest, AModelWithoutARunIsJudgedByItsMatches) {
  ReportPageInput input = Input();
  input.run_json = "";
  RegisteredImage& image = models_[0].images.at(2);
  image.cam_from_world = Rigid3d(Eigen::Quaterniond(0, 0, 0, 1), Eigen::Vector3d(9, 9, 9));
  const Json finding = Data(input)["findings"][0];
  EXPECT_THAT(finding["what"].get<std::string>(), HasSubstr("contradict most"));
  EXPECT_THAT(finding["images"], Contains(1));
}

TEST_F(ReportPageTest, LimitsHold) {
  ReportPageInput input = Input();
  input.limits = {.thumbnail_bytes = 0, .points = 50, .pairs = 5, .matches = 60};
  const Json data = Data(input);
  EXPECT_LE(data["models"][0]["shown"], 50);
  EXPECT_GT(data["models"][0]["shown"], 20);
  EXPECT_EQ(data["pairs"]["shown"], 5);
  EXPECT_EQ(data["pairs"]["total"], 16);
}

TEST_F(ReportPageTest, ThumbnailsKeepWithinTheirLimit) {
  const TempFolder folder;
  Bitmap bitmap{640, 480, 3, std::vector<uint8_t>(640 * 480 * 3)};
  for (size_t i = 0; i < bitmap.data.size(); ++i)
    bitmap.data[i] = static_cast<uint8_t>(i * i * 7919 >> 8);
  for (const Image& image : database_.ReadImages()) WriteBitmap(folder / image.name, bitmap);
  ReportPageInput input = Input();
  input.image_path = folder.path();
  const size_t without = MakeReportPage(database_, Input()).html.size();
  for (const int64_t limit : {200'000, 30'000}) {
    input.limits.thumbnail_bytes = limit;
    const ReportPage page = MakeReportPage(database_, input);
    EXPECT_EQ(DataOf(page)["thumbnails"]["absent"], 0);
    const auto added = static_cast<int64_t>(page.html.size() - without);
    EXPECT_LT(added, limit * 4 / 3 + 200);
    EXPECT_GT(added, limit / 3);
  }
}

TEST_F(ReportPageTest, OfManyPhotographsSomeHaveThumbnails) {
  const TempFolder folder;
  const Bitmap bitmap{64, 48, 3, std::vector<uint8_t>(64 * 48 * 3, 100)};
  for (const Image& image : database_.ReadImages()) WriteBitmap(folder / image.name, bitmap);
  ReportPageInput input = Input();
  input.image_path = folder.path();
  input.limits.thumbnail_bytes = 4000;  // of four of the eight
  const Json thumbnails = Data(input)["thumbnails"];
  EXPECT_EQ(thumbnails["absent"], 0);
  EXPECT_TRUE(MakeReportPage(database_, input).warnings.empty());
  EXPECT_GT(MakeReportPage(database_, input).html.size(),
            MakeReportPage(database_, Input()).html.size() + 1500);
}

TEST_F(ReportPageTest, KeypointsOfAnotherProgramAreRefused) {
  models_[0].images.at(1).points2D.pop_back();
  models_[0].images.at(1).point3D_ids.pop_back();
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { MakeReportPage(database_, Input()); }),
              HasSubstr("has other keypoints than in the database"));
}

TEST_F(ReportPageTest, ConfidencesAreThoseOfTheRun) {
  std::vector<std::map<image_t, PoseConfidence>> confidences(1);
  for (const auto& [id, image] : models_[0].images) confidences[0][id] = {7, 0.5, 0.25};
  ReportPageInput input = Input();
  EXPECT_NE(Data(input)["images"]["list"][0]["rotation_sigma_deg"], 0.5);
  input.confidences = confidences;
  EXPECT_EQ(Data(input)["images"]["list"][0]["rotation_sigma_deg"], 0.5);
}

TEST_F(ReportPageTest, DeeplyNestedReportsAreNoReports) {
  ReportPageInput input = Input();
  input.run_json =
      R"({"succeeded": false, "x": )" + std::string(200'000, '[') + std::string(200'000, ']') + "}";
  EXPECT_FALSE(MakeReportPage(database_, input).html.empty());
}

TEST_F(ReportPageTest, PhotographsAndThreeThatAreAbsentAreNamed) {
  ReportPageInput input = Input();
  input.image_path = "/nonexistent";
  input.three_folder = "/nonexistent";
  const ReportPage page = MakeReportPage(database_, input);
  ASSERT_EQ(page.warnings.size(), 2u);
  EXPECT_THAT(page.warnings[0], HasSubstr("libjs-three"));
  EXPECT_THAT(page.warnings[1], HasSubstr("8 of 8 photographs"));
}

TEST_F(ReportPageTest, AModelOfAnotherDatabaseIsRefused) {
  models_[0].images.at(1).image.name = "another.jpg";
  EXPECT_THROW(MakeReportPage(database_, Input()), ConfigError);
}

TEST_F(ReportPageTest, CamerasOfModelsMayHaveOtherIds) {
  Reconstruction& model = models_[0];
  Camera camera = model.cameras.begin()->second;
  camera.camera_id = 77;
  model.cameras = {{77, camera}};
  for (auto& [id, image] : model.images) image.image.camera_id = 77;
  EXPECT_TRUE(Data(Input())["cameras"][0].contains("map"));
}

TEST_F(ReportPageTest, AnEmptyDatabaseHasAPage) {
  const Database empty(":memory:");
  const ViewGraph graph;
  ReportPageInput input{.title = "",
                        .image_path = "",
                        .models = {},
                        .model_names = {},
                        .graph = graph,
                        .run_json = "",
                        .build_json = "no json"};
  EXPECT_TRUE(DataOf(MakeReportPage(empty, input))["images"]["list"].empty());
}

}  // namespace
}  // namespace cairn
