// The whole road through the programs: rendered photographs with distractors, to a model near the
// truth.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "cairn/database/database.h"
#include "cairn/io/colmap_model.h"
#include "integration/scene_files.h"
#include "support/check_consistency.h"
#include "support/test.h"

namespace cairn {
namespace {

ProgramResult Reconstruct(const SceneFiles& scene, const std::string& output,
                          const std::vector<std::string>& others = {}) {
  std::vector<std::string> arguments = {"reconstruct",  "--database_path", scene.database(),
                                        "--image_path", scene.images(),    "--output_path",
                                        output};
  arguments.insert(arguments.end(), others.begin(), others.end());
  return RunProgram("global_sfm", arguments);
}

nlohmann::json Evaluate(const std::string& model, const std::string& json_path) {
  const ProgramResult result =
      RunProgram("global_sfm", {"evaluate", "--model_path", model, "--reference_path",
                                SceneFiles::truth(), "--output_path", json_path});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  return nlohmann::json::parse(ReadFile(json_path));
}

TEST(EndToEnd, TheModelIsNearTheTruthAndHasNoDistractor) {
  const SceneFiles scene;
  const std::string output = scene / "out";
  const ProgramResult result = Reconstruct(scene, output);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  for (const std::string file :
       {"sparse/0/cameras.bin", "sparse/0/images.bin", "sparse/0/points3D.bin", "bundle.out",
        "list.txt", "points.ply", "report.json", "effective.toml"}) {
    EXPECT_TRUE(std::filesystem::exists(output + "/" + file)) << file;
  }
  const Reconstruction model = ReadColmapModel(output + "/sparse/0");
  CheckConsistency(model);
  EXPECT_EQ(model.images.size(), 8u);
  for (const auto& [id, image] : model.images) {
    EXPECT_EQ(image.image.name.rfind("image", 0), 0u) << image.image.name << " is a distractor";
  }
  EXPECT_GT(model.points3D.size(), 200u);
  EXPECT_LT(model.MeanReprojectionErrorPx(), 1.0);
  const auto gray = [](const Point3D& p) { return p.color[0] == 0 && p.color[1] == 0; };
  int num_black = 0;
  for (const auto& [id, point] : model.points3D) num_black += gray(point);
  EXPECT_LT(num_black, 0.1 * model.points3D.size()) << "points have the photographs' colours";

  const nlohmann::json figures = Evaluate(output + "/sparse/0", scene / "figures.json");
  EXPECT_EQ(figures["registered"], 8);
  EXPECT_GT(figures["auc@10"], 90.0);  // tiny photographs, focal lengths guessed and refined
  EXPECT_LT(figures["focal_rel_med"], 0.05);
}

// `mpirun global_sfm` works once, in its first process.
TEST(EndToEnd, ProcessesBesideTheFirstHaveNothingToDo) {
  const SceneFiles scene;
  for (const std::string rank : {"0", "1"}) {
    const ProgramResult result =
        RunExecutable("env", {"OMPI_COMM_WORLD_SIZE=2", "OMPI_COMM_WORLD_RANK=" + rank,
                              CAIRN_BINARY_DIR "/bin/global_sfm", "inspect", "--database_path",
                              scene.database()});
    EXPECT_EQ(result.exit_code, 0) << result.output;
    const auto is_said = HasSubstr("rank 1 ends");
    EXPECT_THAT(result.output, rank == "1" ? is_said : HasSubstr("images"));
  }
}

// Given cameras stay constant, though nobody says so with --refine_intrinsics.
TEST(EndToEnd, TheOptionsOfARunGiveItsModelAgain) {
  const SceneFiles scene;
  const ProgramResult built = scene.BuildViewGraph(
      scene / "known.db",
      {"--single_camera", "--camera_model", "PINHOLE", "--camera_params", "499,499,240,180"});
  ASSERT_EQ(built.exit_code, 0) << built.output;
  const auto reconstruct = [&](const std::vector<std::string>& options, const std::string& output) {
    std::vector<std::string> arguments = {"reconstruct", "--output_path", scene / output};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const ProgramResult result = RunProgram("global_sfm", arguments);
    EXPECT_EQ(result.exit_code, 0) << result.output;
    return ReadFile(scene / (output + "/sparse/0/cameras.bin"));
  };
  const std::string cameras = reconstruct({"--database_path", scene / "known.db"}, "first");
  EXPECT_EQ(reconstruct({"--config", scene / "first/effective.toml"}, "again"), cameras);
}

TEST(EndToEnd, AnyNumberOfThreadsGivesTheSameBytes) {
  const SceneFiles scene;
  for (const std::string threads : {"1", "2", "8"}) {
    const ProgramResult result = Reconstruct(scene, scene / threads, {"--num_threads", threads});
    ASSERT_EQ(result.exit_code, 0) << result.output;
    for (const std::string file :
         {"sparse/0/cameras.bin", "sparse/0/images.bin", "sparse/0/points3D.bin", "points.ply",
          "bundle.out", "confidence.csv"}) {
      EXPECT_TRUE(ReadFile(scene / (threads + "/" + file)) == ReadFile(scene / ("1/" + file)))
          << file << " with " << threads << " threads";
    }
  }
}

TEST(EndToEnd, ExportWritesEveryType) {
  const SceneFiles scene;
  ASSERT_EQ(Reconstruct(scene, scene / "out").exit_code, 0);
  for (const std::string type :
       {"colmap_bin", "colmap_txt", "bundler", "ply", "gltf", "nerfstudio"}) {
    const std::string path = scene / ("export_" + type + (type == "ply" ? ".ply" : ""));
    const ProgramResult result =
        RunProgram("global_sfm", {"export", "--model_path", scene / "out/sparse/0", "--output_path",
                                  path, "--output_type", type});
    EXPECT_EQ(result.exit_code, 0) << result.output;
    EXPECT_TRUE(std::filesystem::exists(path));
  }
  // The largest model of the folder, for every command.
  const std::string with_frusta = ReadFile(scene / "export_ply.ply");
  for (std::vector<std::string> arguments :
       {std::vector<std::string>{"inspect"},
        {"evaluate", "--reference_path", SceneFiles::truth()},
        {"export", "--output_path", scene / "export_ply.ply", "--output_type", "ply"}}) {
    arguments.insert(arguments.end(), {"--model_path", scene / "out"});
    const ProgramResult result = RunProgram("global_sfm", arguments);
    EXPECT_EQ(result.exit_code, 0) << result.output;
  }
  EXPECT_EQ(ReadFile(scene / "export_ply.ply"), with_frusta);
  // Results of reconstruct are not replaced unasked.
  for (const std::string type : {"bundler", "ply", "nerfstudio"}) {
    const ProgramResult refused =
        RunProgram("global_sfm", {"export", "--model_path", scene / "out", "--output_path",
                                  scene / "out", "--output_type", type});
    EXPECT_EQ(refused.exit_code, 2) << refused.output;
    EXPECT_THAT(refused.output, HasSubstr("is a result of reconstruct, which would be lost"));
  }
  // Nor is its model in a folder of it, whatever is asked.
  for (const std::string overwrite : {"0", "1"}) {
    const ProgramResult refused =
        RunProgram("global_sfm", {"export", "--model_path", scene / "out", "--output_path",
                                  scene / "out/sparse/0", "--overwrite", overwrite});
    EXPECT_EQ(refused.exit_code, 2) << refused.output;
    EXPECT_THAT(refused.output, HasSubstr("holds the results of reconstruct"));
  }
  const Reconstruction binary = ReadColmapModel(scene / "out/sparse/0");
  const Reconstruction text = ReadColmapModel(scene / "export_colmap_txt");
  EXPECT_EQ(binary.images.size(), text.images.size());
  EXPECT_EQ(binary.points3D.size(), text.points3D.size());
}

TEST(EndToEnd, InspectWritesPairsAndTheViewGraph) {
  const SceneFiles scene;
  const auto inspect = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"inspect", "--database_path", scene.database()});
    return RunProgram("global_sfm", arguments);
  };
  const ProgramResult result = inspect({"--pairs_csv", scene / "pairs.csv", "--graph_json",
                                        scene / "graph.json", "--graph_dot", scene / "graph.dot"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const nlohmann::json graph = nlohmann::json::parse(ReadFile(scene / "graph.json"));
  EXPECT_THAT(result.output,
              HasSubstr("10 images, " + std::to_string(graph["edges"].size()) + " edges, "));
  EXPECT_EQ(LinesWith(ReadFile(scene / "graph.dot"), " -- ").size(), graph["edges"].size());
  const std::string pairs = ReadFile(scene / "pairs.csv");
  // Of all pairs with matches or results.
  EXPECT_GE(LinesWith(pairs, ".jpg,").size(), graph["edges"].size());
  EXPECT_LE(LinesWith(pairs, ".jpg,").size(), 45u);
  // The chosen results are the cascade's, the only verifier here.
  EXPECT_EQ(inspect({"--pairs_csv", scene / "of.csv", "--pairs_verifier", "cascade"}).exit_code, 0);
  EXPECT_EQ(LinesWith(ReadFile(scene / "of.csv"), ".jpg,").size(),
            LinesWith(pairs, ".jpg,").size());
  const ProgramResult other =
      inspect({"--pairs_csv", scene / "of.csv", "--pairs_verifier", "five_point"});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.output, HasSubstr("the database has cascade"));
  const ProgramResult no_file = inspect({"--pairs_verifier", "five_point"});
  EXPECT_EQ(no_file.exit_code, 2);
  EXPECT_THAT(no_file.output, HasSubstr("--pairs_verifier: needs --pairs_csv"));
}

TEST(EndToEnd, SynthesizeFillsADatabaseUpToAStage) {
  const TempFolder folder;
  // Images with depth, pairs with matches, pairs with geometries.
  const std::pair<std::string, std::vector<bool>> contents[] = {
      {"features", {false, false, false}},
      {"depth", {true, false, false}},
      {"matches", {true, true, false}},
      {"two_view_geometries", {true, true, true}}};
  for (const auto& [content, expected] : contents) {
    const std::string path = folder / content;
    const ProgramResult result =
        RunProgram("global_sfm", {"synthesize", "--type", "database", "--content", content,
                                  "--num_images", "4", "--output_path", path});
    ASSERT_EQ(result.exit_code, 0) << result.output;
    const Database database(path + "/scene.db", Database::Mode::kReadOnly);
    EXPECT_EQ(database.ReadNumKeypoints().size(), 4u);
    EXPECT_EQ(
        std::vector<bool>({!database.ReadNumDepthSamples().empty(),
                           !database.ReadNumMatches().empty(), !database.ReadNumInliers().empty()}),
        expected)
        << content;
  }
}

// A Bundler file whose list is elsewhere: without it, it cannot be read.
TEST(EndToEnd, ListsOfBundlerFilesCanBeNamed) {
  const SceneFiles scene;
  const std::string bundle = scene.ExportBundler(), list = scene / "names.txt";
  std::filesystem::rename(scene / "bundler/list.txt", list);
  for (std::vector<std::string> arguments :
       {std::vector<std::string>{"inspect", "--model_path", bundle, "--model_list", list},
        {"export", "--model_path", bundle, "--output_path", scene / "model.ply", "--output_type",
         "ply", "--model_list", list},
        {"evaluate", "--model_path", bundle, "--model_list", list, "--reference_path",
         SceneFiles::truth()},
        {"evaluate", "--model_path", SceneFiles::truth(), "--reference_path", bundle,
         "--reference_list", list}}) {
    const ProgramResult result = RunProgram("global_sfm", arguments);
    EXPECT_EQ(result.exit_code, 0) << arguments[0] << result.output;
    const auto flag = std::find_if(arguments.begin(), arguments.end(),
                                   [](const std::string& a) { return a.ends_with("_list"); });
    arguments.erase(flag, flag + 2);
    EXPECT_EQ(RunProgram("global_sfm", arguments).exit_code, 3) << arguments[0];
  }
}

// As README has it for MeshLab: the names in list.txt are those of the images beside it.
TEST(EndToEnd, BundlerFilesOfUndistortedImages) {
  const SceneFiles scene;
  const std::string images = scene / "dense/images";
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"undistort", "--model_path", SceneFiles::truth(), "--image_path",
                                 scene.images(), "--output_path", scene / "dense",
                                 "--center_principal_point", "1"},
        {"export", "--model_path", scene / "dense/sparse", "--output_path", images, "--output_type",
         "bundler"}}) {
    const ProgramResult result = RunProgram("global_sfm", arguments);
    EXPECT_EQ(result.exit_code, 0) << result.output;
  }
  std::ifstream list(images + "/list.txt");
  int num_images = 0;
  for (std::string name; std::getline(list, name); ++num_images) {
    EXPECT_TRUE(std::filesystem::is_regular_file(images + "/" + name)) << name;
  }
  EXPECT_EQ(num_images, 8);
}

// Neither loses the other's results, nor the model that it reads.
TEST(EndToEnd, ReconstructAndUndistortHaveFoldersOfTheirOwn) {
  const SceneFiles scene;
  ASSERT_EQ(Reconstruct(scene, scene / "out").exit_code, 0);
  const auto undistort = [&](const std::string& model, const std::string& output) {
    return RunProgram("global_sfm",
                      {"undistort", "--model_path", model, "--image_path", scene.images(),
                       "--output_path", output, "--output_type", "3dgs", "--overwrite", "1"});
  };
  const std::string model = ReadFile(scene / "out/sparse/0/images.bin");
  for (const std::string& path : {scene / "out", scene / "out/sparse/0", SceneFiles::truth()}) {
    const ProgramResult result = undistort(path, scene / "out");
    EXPECT_EQ(result.exit_code, 2) << result.output;
    EXPECT_THAT(result.output, HasSubstr("give another --output_path")) << path;
  }
  EXPECT_FALSE(std::filesystem::exists(scene / "out/images"));
  EXPECT_EQ(ReadFile(scene / "out/sparse/0/images.bin"), model);

  ASSERT_EQ(undistort(scene / "out", scene / "splats").exit_code, 0);
  const std::string undistorted = ReadFile(scene / "splats/sparse/0/images.bin");
  const ProgramResult result = Reconstruct(scene, scene / "splats", {"--overwrite", "1"});
  EXPECT_EQ(result.exit_code, 2) << result.output;
  EXPECT_THAT(result.output, HasSubstr("holds the results of undistort"));
  EXPECT_EQ(ReadFile(scene / "splats/sparse/0/images.bin"), undistorted);
  EXPECT_EQ(undistort(scene / "out", scene / "splats").exit_code, 0);
  EXPECT_EQ(Reconstruct(scene, scene / "out").exit_code, 0);
}

TEST(EndToEnd, UndistortAndExportNameTheModelsThatTheyLeave) {
  const SceneFiles scene;
  for (const char* model : {"two/sparse/0", "two/sparse/1"}) {
    std::filesystem::create_directories(scene / model);
    std::filesystem::copy(SceneFiles::truth(), scene / model);
  }
  const ProgramResult result =
      RunProgram("global_sfm", {"undistort", "--model_path", scene / "two", "--image_path",
                                scene.images(), "--output_path", scene / "dense"});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr((scene / "two/sparse/1") +
                                       " with 8 more photographs is not undistorted: give it as "
                                       "--model_path"));
  EXPECT_THAT(RunProgram("global_sfm", {"export", "--model_path", scene / "two", "--output_type",
                                        "ply", "--output_path", scene / "two.ply"})
                  .output,
              HasSubstr("sparse/1 with 8 more photographs is not exported"));
}

TEST(EndToEnd, NothingToReconstructIsExitCodeOne) {
  const SceneFiles scene;
  const std::string database = scene / "features.db";
  ASSERT_EQ(scene.BuildViewGraph(database, {"--stop_after", "features"}).exit_code, 0);
  const ProgramResult result =
      RunProgram("global_sfm", {"reconstruct", "--database_path", database, "--image_path",
                                scene.images(), "--output_path", scene / "out"});
  EXPECT_EQ(result.exit_code, 1) << result.output;
  EXPECT_FALSE(std::filesystem::exists(scene / "out/sparse/0/images.bin"));
}

}  // namespace
}  // namespace cairn
