// The programs of apps/examples, on data with known truth.
#include <Eigen/Geometry>
#include <fstream>

#include "cairn/io/colmap_model.h"
#include "integration/scene_files.h"
#include "support/test.h"
#include "support/two_view_problem.h"

namespace cairn {
namespace {

ProgramResult RunExample(const std::string& name, const std::vector<std::string>& arguments) {
  return RunExecutable(CAIRN_BINARY_DIR "/examples/" + name, arguments);
}

Eigen::Matrix3d ReadMatrix(std::istream& in) {
  Eigen::Matrix3d R;
  for (int k = 0; k < 9; ++k) in >> R(k / 3, k % 3);
  return R;
}

double Degrees(const Eigen::Matrix3d& R) { return Eigen::AngleAxisd(R).angle() * 180 / M_PI; }

TEST(Examples, VerifyPairFindsThePose) {
  const TwoViewProblem problem =
      MakeTwoViewProblem({.outlier_ratio = 0.4, .noise = {.image_px = 0.3, .affine = 0.05}}, 1);
  const TempFolder folder;
  std::ofstream file(folder / "pair.txt");
  for (const Camera* camera : {&problem.camera1, &problem.camera2}) {
    file << camera->width << " " << camera->height << " " << camera->FocalX() << "\n";
  }
  for (const FeatureMatch& match : problem.matches) {
    for (const Keypoint& k : {problem.keypoints1[match.point1], problem.keypoints2[match.point2]}) {
      file << k.x << " " << k.y << " " << k.a11 << " " << k.a12 << " " << k.a21 << " " << k.a22
           << "\n";
    }
  }
  file.close();
  const ProgramResult result = RunExample("verify_pair", {folder / "pair.txt"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  std::istringstream words(result.output.substr(result.output.find("R\n") + 2));
  const Eigen::Matrix3d R = ReadMatrix(words);
  EXPECT_LT(Degrees(R * problem.cam2_from_cam1.RotationMatrix().transpose()), 0.5);
  EXPECT_EQ(RunExample("verify_pair", {folder / "nothing.txt"}).exit_code, 2);
}

// The example, and the program's own command.
TEST(Examples, AverageRotationsAgreesWithTheTruth) {
  const TempFolder folder;
  ASSERT_EQ(RunProgram("global_sfm", {"synthesize", "--type", "graph", "--num_images", "40",
                                      "--output_path", folder / "graph"})
                .exit_code,
            0);
  for (const ProgramResult& result :
       {RunExample("average_rotations", {folder / "graph/EGs.txt", folder / "0.txt"}),
        RunProgram("global_sfm", {"rotation_averaging", "--edges_path", folder / "graph/edges.txt",
                                  "--output_path", folder / "1.txt"})}) {
    ASSERT_EQ(result.exit_code, 0) << result.output;
  }
  for (const char* name : {"0.txt", "1.txt"}) {
    std::ifstream file(folder / name), truth(folder / "graph/reference_rotations.txt");
    Eigen::Matrix3d world_from_truth;
    int id = 0, true_id = 0, num_images = 0;
    while (file >> id && truth >> true_id) {
      ASSERT_EQ(id, true_id);
      const Eigen::Matrix3d difference = ReadMatrix(file).transpose() * ReadMatrix(truth);
      if (num_images++ == 0) world_from_truth = difference;
      EXPECT_LT(Degrees(world_from_truth.transpose() * difference), 1.0) << name;
    }
    EXPECT_EQ(num_images, 40) << name;
  }
}

// Of two measurements that are 2 degrees apart, the one with more inliers.
TEST(RotationAveraging, TakesTheWeightsOfItsFile) {
  const TempFolder folder;
  std::ofstream(folder / "edges.txt")
      << "1 2 1 0 0 0 1 0 0 0 1 1\n1 2 0.99939083 -0.03489950 0 0.03489950 0.99939083 0 0 0 1 99\n";
  for (const std::string power : {"0", "1"}) {
    const ProgramResult result = RunProgram(
        "global_sfm", {"rotation_averaging", "--edges_path", folder / "edges.txt", "--output_path",
                       folder / power, "--rotation_averaging.weight_power", power});
    ASSERT_EQ(result.exit_code, 0) << result.output;
    std::ifstream file(folder / power);
    int id = 0;
    file >> id;
    const Eigen::Matrix3d R1 = ReadMatrix(file);
    file >> id;
    EXPECT_NEAR(Degrees(ReadMatrix(file) * R1.transpose()), power == "1" ? 1.98 : 1, 0.05);
  }
  EXPECT_EQ(RunProgram("global_sfm", {"rotation_averaging", "--edges_path", folder / "edges.txt",
                                      "--output_path", folder / "edges.txt"})
                .exit_code,
            2);  // it would be lost
  std::ofstream(folder / "edges.txt") << "1 2 1 0 0 0 1 0 0 0 1 0\n";
  EXPECT_EQ(RunProgram("global_sfm", {"rotation_averaging", "--edges_path", folder / "edges.txt",
                                      "--output_path", folder / "none"})
                .exit_code,
            3);
}

TEST(Examples, ReconstructWritesAColmapModel) {
  const SceneFiles scene;
  const ProgramResult result = RunExample("reconstruct", {scene.database(), scene / "model"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(ReadColmapModel(scene / "model").images.size(), 8u);
  EXPECT_EQ(RunExample("reconstruct", {scene / "no.db", scene / "model"}).exit_code, 2);
}

}  // namespace
}  // namespace cairn
