// Where on Earth a model is, by the program.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "cairn/geometry/gps.h"
#include "cairn/io/colmap_model.h"
#include "cairn/math/angles.h"
#include "integration/scene_files.h"
#include "support/test.h"

namespace cairn {
namespace {

// Positions around 47 degrees north, 11.12 m for a unit of the true model; the last but one may be
// wrong.
void WritePositions(const Reconstruction& model, const std::string& path, bool has_wrong) {
  std::ofstream file(path);
  file << std::setprecision(17);
  size_t left = model.images.size();
  for (const auto& [id, image] : model.images) {
    const Eigen::Vector3d center = image.cam_from_world.Center();
    const double off = has_wrong && --left == 1 ? 0.01 : 0.0;
    const double unit_deg = 1e-4, cosine = std::cos(DegToRad(47));
    file << image.image.name << " " << 47 + unit_deg * center.y() + off << " "
         << 8 + unit_deg / cosine * center.x() << " " << 500 + 11.12 * center.z() << "\n";
  }
}

TEST(Georegister, WrongPositionsAreNamedAndTheModelIsMoved) {
  const SceneFiles scene;
  const Reconstruction truth = ReadColmapModel(SceneFiles::truth());
  WritePositions(truth, scene / "gps.txt", true);
  const ProgramResult result =
      RunProgram("global_sfm", {"georegister", "--model_path", SceneFiles::truth(), "--gps_path",
                                scene / "gps.txt", "--output_path", scene / "enu"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  // A model of another program is not replaced unasked.
  std::filesystem::copy(SceneFiles::truth(), scene / "theirs");
  std::vector<std::string> over = {"georegister",   "--model_path",    SceneFiles::truth(),
                                   "--gps_path",    scene / "gps.txt", "--output_path",
                                   scene / "theirs"};
  EXPECT_EQ(RunProgram("global_sfm", over).exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(scene / "theirs/georegistration.json"));
  over.insert(over.end(), {"--overwrite", "1"});
  EXPECT_EQ(RunProgram("global_sfm", over).exit_code, 0);
  const auto json = nlohmann::json::parse(ReadFile(scene / "enu/georegistration.json"));
  const LocalFrame frame({json["origin"]["latitude_deg"], json["origin"]["longitude_deg"],
                          json["origin"]["altitude_m"].get<double>()});
  int num_wrong = 0;
  for (const auto& image : json["images"]) num_wrong += image["is_wrong"].get<bool>();
  EXPECT_EQ(num_wrong, 1);
  EXPECT_THAT(result.output, HasSubstr("m north"));
  // The moved cameras are where the residuals say.
  const Reconstruction moved = ReadColmapModel(scene / "enu");
  for (const auto& [id, image] : moved.images) {
    for (const auto& row : json["images"]) {
      if (row["name"] != image.image.name) continue;
      const Eigen::Vector3d gps =
          frame.FromGps({row["gps"]["latitude_deg"], row["gps"]["longitude_deg"],
                         row["gps"]["altitude_m"].get<double>()});
      const Eigen::Vector3d residual(row["residual_m"][0], row["residual_m"][1],
                                     row["residual_m"][2]);
      EXPECT_LT((image.cam_from_world.Center() - gps - residual).norm(), 1e-6);
    }
  }
}

TEST(Georegister, NamesTheModelsThatItLeaves) {
  const SceneFiles scene;
  WritePositions(ReadColmapModel(SceneFiles::truth()), scene / "gps.txt", false);
  for (const char* model : {"two/0", "two/1"}) {
    std::filesystem::create_directories(scene / model);
    std::filesystem::copy(SceneFiles::truth(), scene / model);
  }
  const ProgramResult result =
      RunProgram("global_sfm", {"georegister", "--model_path", scene / "two", "--gps_path",
                                scene / "gps.txt", "--output_path", scene / "enu"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output,
              HasSubstr((scene / "two/1") + " with 8 more photographs is not georegistered"));
}

TEST(Georegister, ReconstructPutsModelsInTheFrame) {
  const SceneFiles scene;
  WritePositions(ReadColmapModel(SceneFiles::truth()), scene / "gps.txt", true);
  const std::vector<std::string> arguments = {
      "reconstruct",     "--database_path", scene.database(),
      "--output_path",   scene / "model",   "--gps_path",
      scene / "gps.txt", "--report",        "0"};
  EXPECT_EQ(RunProgram("global_sfm", arguments).exit_code, 2);  // what is it for?
  std::vector<std::string> with = arguments;
  with.insert(with.end(), {"--use_gps", "1"});
  const ProgramResult result = RunProgram("global_sfm", with);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  // Exact positions show the model's own errors, so others may be named, too.
  EXPECT_THAT(result.output, HasSubstr("positions far from where the others put them"));
  EXPECT_THAT(result.output, HasSubstr("image00006.jpg"));
  const auto json = nlohmann::json::parse(ReadFile(scene / "model/sparse/0/georegistration.json"));
  EXPECT_LT(json["median_residual_m"], 0.2);
  EXPECT_THAT(result.output, HasSubstr(" m from known positions (median)"));
  const Reconstruction model = ReadColmapModel(scene / "model/sparse/0");
  for (const auto& row : json["images"]) {
    const Eigen::Vector3d gps(row["gps_enu"][0], row["gps_enu"][1], row["gps_enu"][2]);
    for (const auto& [id, image] : model.images) {
      if (row["name"] != image.image.name || row["is_wrong"]) continue;
      EXPECT_LT((image.cam_from_world.Center() - gps).norm(), 1);
    }
  }
  // What goes on from it stays there; the residuals were those of the model before.
  const auto read_place = [&] {
    return nlohmann::json::parse(ReadFile(scene / "model/sparse/0/georegistration.json"));
  };
  const nlohmann::json place = read_place();
  const ProgramResult again = RunProgram(
      "global_sfm", {"reconstruct", "--database_path", scene.database(), "--input_path",
                     scene / "model", "--output_path", scene / "model", "--report", "0"});
  ASSERT_EQ(again.exit_code, 0) << again.output;
  const nlohmann::json kept = read_place();
  EXPECT_EQ(kept["origin"], place["origin"]);
  EXPECT_EQ(kept["enu_from_world"], place["enu_from_world"]);
  EXPECT_FALSE(kept.contains("images"));
}

// Its images are reconstructed from nothing, in another frame.
TEST(Georegister, TheModelsThatReplaceAGivenUpOneAreNotWhereItWas) {
  const SceneFiles scene;
  Reconstruction wrong = ReadColmapModel(SceneFiles::truth());
  for (auto& [id, image] : wrong.images) {
    const Eigen::AngleAxisd turn(id, Eigen::Vector3d(1, id, 2).normalized());
    image.cam_from_world.rotation = turn * image.cam_from_world.rotation;
  }
  WriteColmapModel(wrong, scene / "wrong");
  WriteFileAtomically(scene / "wrong/georegistration.json",
                      R"({"axes": "", "origin": {}, "enu_from_world": {}})");
  const ProgramResult result = RunProgram(
      "global_sfm", {"reconstruct", "--database_path", scene.database(), "--input_path",
                     scene / "wrong", "--output_path", scene / "model", "--report", "0"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("was given up"));
  EXPECT_FALSE(std::filesystem::exists(scene / "model/sparse/0/georegistration.json"));
}

TEST(Georegister, ControlPointsAreReported) {
  const SceneFiles scene;
  const Reconstruction truth = ReadColmapModel(SceneFiles::truth());
  std::ofstream file(scene / "gcp_list.txt");
  file << std::setprecision(17) << "EPSG:4326\n";
  int index = 0;
  for (const Eigen::Vector3d& xyz :
       {Eigen::Vector3d(0.2, 0, 0), {0, 0.3, 0.1}, {0.1, 0.1, 0.4}, {-0.2, 0.1, 0.2}}) {
    ++index;
    for (const auto& [id, image] : truth.images) {
      const auto pixel = truth.CameraOf(image).ImgFromRay(image.cam_from_world * xyz);
      ASSERT_TRUE(pixel);
      file << 8 + 1e-4 / std::cos(DegToRad(47)) * xyz.x() << " " << 47 + 1e-4 * xyz.y() << " "
           << 11.12 * xyz.z() << " " << pixel->x() - 0.5 << " " << pixel->y() - 0.5 << " "
           << image.image.name << " " << (index == 4 ? "CHK-" : "P") << index << "\n";
    }
  }
  file.close();
  const ProgramResult result =
      RunProgram("global_sfm", {"georegister", "--model_path", SceneFiles::truth(), "--gcp_path",
                                scene / "gcp_list.txt", "--output_path", scene / "enu"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("control point P1: "));
  EXPECT_THAT(result.output, HasSubstr("in 8 images (check)"));
  const auto json = nlohmann::json::parse(ReadFile(scene / "enu/georegistration.json"));
  EXPECT_TRUE(json["by_control_points"]);
  EXPECT_EQ(json["control_points"].size(), 4u);
}

// What is said of a model is not left beside it, where the next model would be taken for that one.
TEST(Georegister, WithoutAnOutputPathNothingIsWritten) {
  const SceneFiles scene;
  WritePositions(ReadColmapModel(SceneFiles::truth()), scene / "gps.txt", false);
  WriteColmapModel(ReadColmapModel(SceneFiles::truth()), scene / "model/sparse/0");
  WriteFileAtomically(scene / "model/report.json", "{}");
  WriteFileAtomically(scene / "model/effective.toml", "");
  const auto num_files = [&] {
    return std::distance(std::filesystem::recursive_directory_iterator(scene / "model"), {});
  };
  const auto num_before = num_files();
  for (const char* model : {"model", "model/sparse/0"}) {
    const ProgramResult result =
        RunProgram("global_sfm",
                   {"georegister", "--model_path", scene / model, "--gps_path", scene / "gps.txt"});
    EXPECT_EQ(result.exit_code, 0) << result.output;
    EXPECT_THAT(result.output, HasSubstr("8 positions agree"));
    EXPECT_EQ(num_files(), num_before);
  }
}

// A Bundler file has no image sizes: they are those of the photographs, or there is no model.
TEST(Georegister, BundlerGetsItsSizesFromThePhotographs) {
  const SceneFiles scene;
  WritePositions(ReadColmapModel(SceneFiles::truth()), scene / "gps.txt", false);
  std::vector<std::string> arguments = {"georegister", "--model_path",    scene.ExportBundler(),
                                        "--gps_path",  scene / "gps.txt", "--output_path",
                                        scene / "enu"};
  const ProgramResult refused = RunProgram("global_sfm", arguments);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.output, HasSubstr("image_path: the model has no image sizes"));
  EXPECT_FALSE(std::filesystem::exists(scene / "enu"));
  arguments.insert(arguments.end(), {"--image_path", scene.images()});
  const ProgramResult result = RunProgram("global_sfm", arguments);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const Reconstruction model = ReadColmapModel(scene / "enu");
  EXPECT_EQ(model.cameras.begin()->second.width, 480);
  EXPECT_EQ(model.cameras.begin()->second.height, 360);
}

TEST(Georegister, FailuresSayWhatIsMissing) {
  const SceneFiles scene;
  std::ofstream(scene / "gps.txt") << "other.jpg 47 8 500\n";
  const std::vector<std::string> model = {"georegister", "--model_path", SceneFiles::truth()};
  const auto run = [&](std::vector<std::string> others) {
    others.insert(others.begin(), model.begin(), model.end());
    return RunProgram("global_sfm", others);
  };
  EXPECT_EQ(run({}).exit_code, 2);
  EXPECT_EQ(run({"--gps_path", scene / "absent.txt"}).exit_code, 3);
  for (const auto& [flag, path] :
       {std::pair("--gps_path", "gps.txt"), {"--image_path", "images"}}) {
    const ProgramResult result = run({flag, scene / path});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.output, HasSubstr("0 images of the model have a position"));
  }
}

}  // namespace
}  // namespace cairn
