// All stages on 1DSfM data sets.
#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/io/one_dsfm_writer.h"
#include "cairn/pipeline/build_pipeline.h"
#include "support/test.h"
#include "support/thrown_message.h"
#include "unit/pipeline/wall_fixture.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

class DatasetPipelineTest : public WallTest {
 protected:
  DatasetPipelineTest() : WallTest(4, 8) {}
};

// A 1DSfM data set of the photographs, with or without them.
OneDsfmFiles Dataset() {
  OneDsfmFiles files;
  for (int i = 0; i < 4; ++i) {
    files.images.push_back({"images/photo" + std::to_string(i) + ".png", 150.0 + i});
    OneDsfmImageKeys keys;
    keys.index = i;
    keys.name = files.images.back().name;
    keys.principal_point = {80, 60};
    for (int k = 0; k < 30; ++k) keys.keys.push_back({2 * k, {10.5 + k, 20.5 + i}, {0, 0, 0}});
    files.coords.push_back(keys);
  }
  files.component = {0, 1, 3};
  const Rigid3d pose(Eigen::Quaterniond(0.8, 0.6, 0, 0), {0, 0.6, 0.8});
  files.edges = {{0, 1, pose}, {3, 1, pose}, {0, 2, pose}};
  for (int k = 0; k < 25; ++k) files.tracks.push_back({{0, 2 * k}, {1, 2 * k}, {2, 0}});
  return files;
}

TEST_F(DatasetPipelineTest, ADatasetWithoutPhotographsIsImported) {
  WriteOneDsfmFiles(folder_ / "set", Dataset());
  BuildPipelineOptions options;
  options.inputs.dataset_path = folder_ / "set";
  options.inputs.database_path = folder_ / "a.db";
  const BuildPipelineReport report = RunBuildPipeline(options);
  EXPECT_EQ(report.run.failure, "");
  EXPECT_EQ(report.summary.num_images, 3);
  EXPECT_EQ(report.summary.num_verified, 2);
  EXPECT_EQ(report.summary.largest_component, 3);
  const Database database(folder_ / "a.db");
  EXPECT_EQ(database.ReadImages()[2].name, "photo3.png");
  EXPECT_EQ(database.ReadImages()[2].image_id, 4u);
  EXPECT_EQ(database.ReadCameras()[0].width, 160);
  EXPECT_EQ(database.ReadCameras()[0].FocalX(), 150);
  EXPECT_FLOAT_EQ((*database.ReadKeypoints(1))[3].x, 13.5f);
  EXPECT_EQ(database.ReadMatches(ImagePairToPairId(1, 2))->size(), 25u);
  EXPECT_EQ((*database.ReadMatches(ImagePairToPairId(1, 2)))[7], (FeatureMatch{7, 7}));
  const std::vector<PairMetrics> edges = database.ReadPairMetrics();
  ASSERT_EQ(edges.size(), 2u);
  const auto rotation = [&](const PairMetrics& edge) {
    EXPECT_EQ(edge.verifier, "imported");
    return database.ReadTwoViewGeometry(edge.pair_id)->cam2_from_cam1->rotation;
  };
  const Rigid3d pose(Eigen::Quaterniond(0.8, 0.6, 0, 0), {0, 0.6, 0.8});
  EXPECT_LT(rotation(edges[0]).angularDistance(pose.rotation), 1e-9);
  EXPECT_EQ(edges[0].num_inliers, 25);
  EXPECT_EQ(edges[1].pair_id, ImagePairToPairId(2, 4));  // Stored as (3, 1).
  EXPECT_LT(rotation(edges[1]).angularDistance(pose.rotation.conjugate()), 1e-9);
  EXPECT_EQ(edges[1].num_inliers, 0);
  const std::string dump = Dump("a.db");
  RunBuildPipeline(options);
  EXPECT_EQ(Dump("a.db"), dump);
  for (std::string BuildInputs::*of_photographs :
       {&BuildInputs::depth_path, &BuildInputs::gps_path, &BuildInputs::depth_model,
        &BuildInputs::mask_path}) {
    BuildPipelineOptions other = options;
    other.inputs.*of_photographs = folder_ / "set";
    EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(other); }),
                HasSubstr(": the data set has no photographs"));
  }
}

TEST_F(DatasetPipelineTest, AnImportedDatasetKeepsItsEdgesAndItsOptions) {
  WriteOneDsfmFiles(folder_ / "set", Dataset());
  BuildPipelineOptions options;
  options.inputs.dataset_path = folder_ / "set";
  options.inputs.database_path = folder_ / "a.db";
  options.cameras.camera_model = CameraModel::kPinhole;
  RunBuildPipeline(options);
  const std::string dump = Dump("a.db");
  for (const std::string& dataset_path : {options.inputs.dataset_path, std::string()}) {
    for (const BuildStage stage : {BuildStage::kChanged, BuildStage::kCameras, BuildStage::kPairs,
                                   BuildStage::kMatching, BuildStage::kVerification}) {
      BuildPipelineOptions recompute = options;
      recompute.inputs.dataset_path = dataset_path;
      recompute.inputs.recompute = stage;
      EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(recompute); }),
                  HasSubstr("use a new database"));
      EXPECT_EQ(Dump("a.db"), dump) << NameOf(kBuildStages, stage);
    }
  }
  EXPECT_THAT(StoredOptions(options.inputs),
              ElementsAre(HasSubstr("camera_model = \"PINHOLE\"\n")));
  options.cameras = {};
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("made with \"PINHOLE\"; use the same, or a new database"));
}

TEST_F(DatasetPipelineTest, ATrackWithoutItsKeyIsNamedWithItsLine) {
  const auto message = [&](const OneDsfmFiles& files) -> std::string {
    WriteOneDsfmFiles(folder_ / "set", files);
    BuildPipelineOptions options;
    options.inputs.dataset_path = folder_ / "set";
    options.inputs.database_path = folder_ / "a.db";
    return ThrownMessage<IoError>([&] { RunBuildPipeline(options); });
  };
  OneDsfmFiles odd_key = Dataset();
  odd_key.tracks[3][1].key = 7;
  EXPECT_THAT(message(odd_key), HasSubstr("tracks.txt:5: coords.txt has no key 7 of image 1"));
  OneDsfmFiles no_image = Dataset();
  no_image.coords.erase(no_image.coords.begin());
  EXPECT_THAT(message(no_image), HasSubstr("tracks.txt:2: coords.txt has no key 0 of image 0"));
  EXPECT_EQ(message(Dataset()), "no error");
}

TEST_F(DatasetPipelineTest, ADatasetWithPhotographsHasItsPairsMatched) {
  WriteOneDsfmFiles(folder_ / "set", Dataset());
  fs::rename(Images(), folder_ / "set/images");
  BuildPipelineOptions options = Options("a.db");
  options.inputs.image_path = "";
  options.inputs.dataset_path = folder_ / "set";
  const BuildPipelineReport report = RunBuildPipeline(options);
  EXPECT_EQ(report.summary.num_images, 3);
  const Database database(folder_ / "a.db");
  EXPECT_EQ(database.ReadCameras()[2].FocalX(), 153);
  std::vector<image_pair_t> pairs;
  for (const auto& [pair, num] : database.ReadNumMatches()) pairs.push_back(pair);
  EXPECT_THAT(pairs, ElementsAre(ImagePairToPairId(1, 2), ImagePairToPairId(2, 3)));
  EXPECT_EQ(report.summary.num_tried + report.summary.num_too_few, 2);
  options.inputs.pairs = "exhaustive";
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("--pairs cannot be given too"));
  options.inputs.pairs = "auto";
  options.inputs.image_path = folder_ / "set/images";
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("dataset_path"));
}

}  // namespace
}  // namespace cairn
