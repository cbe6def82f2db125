// Agreement with ../shared/tools/eval_poses.py, the independent script, on real ground truth.
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "cairn/base/rng.h"
#include "cairn/evaluation/pose_evaluation.h"
#include "cairn/io/bundler.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/model.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"
#include "support/shared_data.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

std::string ScriptPath() { return SharedDataPath("../tools/eval_poses.py"); }

bool HasPython() { return std::system("/usr/bin/python3 -c 'import numpy' > /dev/null 2>&1") == 0; }

nlohmann::json RunScript(const std::string& arguments, const TempFolder& folder) {
  const std::string command =
      "/usr/bin/python3 " + ScriptPath() + " " + arguments + " > " + (folder / "out.json");
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  return nlohmann::json::parse(ReadFile(folder / "out.json"));
}

// Every pose disturbed a little, one by a lot, the last images left out.
Reconstruction Perturbed(const Reconstruction& reference, double angle_rad, double distance,
                         int num_left_out, uint64_t seed) {
  Reconstruction r;
  r.cameras = reference.cameras;
  r.images = reference.images;
  Rng rng(seed);
  const auto random = [&] { return GaussianVector<3>(rng); };
  for (int i = 0; i < num_left_out; ++i) r.images.erase(std::prev(r.images.end()));
  for (auto& [id, image] : r.images) {
    const double factor = image.image.image_id == 2 ? 100 : 1;
    const Eigen::Vector3d center = image.cam_from_world.Center() + factor * distance * random();
    const Eigen::Quaterniond q =
        ExpSO3(factor * angle_rad * random()) * image.cam_from_world.rotation;
    image.cam_from_world = Rigid3d(q.normalized(), q * -center);
    image.points2D.clear();
    image.point3D_ids.clear();
  }
  r.Transform({2.5, ExpSO3(random()), random()});
  return r;
}

// The script rounds; its random triples differ from ours, which the last digit may show.
void ExpectAgreement(const PoseEvaluation& e, const nlohmann::json& script) {
  EXPECT_EQ(e.num_registered, script["registered"].get<int>());
  EXPECT_EQ(e.num_reference, script["gt"].get<int>());
  const std::array<const char*, 4> keys = {"auc@1", "auc@3", "auc@5", "auc@10"};
  for (size_t k = 0; k < keys.size(); ++k) {
    EXPECT_NEAR(100 * e.auc[k], script[keys[k]].get<double>(), 0.00501) << keys[k];
  }
  EXPECT_NEAR(*e.relative_rotation_median_deg, script["rel_rot_med_deg"].get<double>(), 5.1e-5);
  EXPECT_NEAR(*e.relative_translation_median_deg, script["rel_trans_med_deg"].get<double>(),
              5.1e-5);
  const double tolerance = 1e-5 + 1e-3 * e.center->median;
  EXPECT_NEAR(e.center->median, script["center_med"].get<double>(), tolerance);
  EXPECT_NEAR(e.center->mean, script["center_mean"].get<double>(), tolerance);
  EXPECT_NEAR(e.center->median / *e.extent, script["center_med_rel"].get<double>(),
              1e-6 + tolerance / *e.extent);
}

class AgainstScript : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Scenes, AgainstScript,
                         ::testing::Values("strecha/fountain-P11", "strecha/entry-P10", "lund_door",
                                           "temple_ring", "strecha_29"),
                         [](const auto& info) {
                           std::string name = info.param;
                           for (char& c : name) c = std::isalnum(c) ? c : '_';
                           return name;
                         });

TEST_P(AgainstScript, Agrees) {
  const std::string gt = SharedDataPath(GetParam()) + "/gt";
  if (!std::filesystem::exists(gt)) GTEST_SKIP() << gt << " is absent";
  if (!std::filesystem::exists(ScriptPath())) GTEST_SKIP() << ScriptPath() << " is absent";
  if (!HasPython()) GTEST_SKIP() << "/usr/bin/python3 with numpy is absent";
  const TempFolder folder;
  const Reconstruction reference = ReadModel(gt);
  for (const auto& [angle_rad, distance, num_left_out] :
       {std::tuple(2e-3, 0.002, 0), std::tuple(2e-2, 0.05, 2)}) {
    const Reconstruction estimate =
        Perturbed(reference, angle_rad, distance, num_left_out, 1 + num_left_out);
    WriteColmapModel(estimate, folder / "model");
    const PoseEvaluation e =
        EvaluatePoses(PosedCamerasOf(ReadModel(folder / "model")), PosedCamerasOf(reference));
    ExpectAgreement(e, RunScript(gt + " " + (folder / "model"), folder));
    EXPECT_NEAR(e.focal_relative->mean, 0, 1e-12);
  }
}

TEST(BundlerAgainstScript, Agrees) {
  const std::string gt = SharedDataPath("lund_door/gt");
  if (!std::filesystem::exists(gt) || !std::filesystem::exists(ScriptPath()) || !HasPython()) {
    GTEST_SKIP() << gt << " or the script or python is absent";
  }
  const TempFolder folder;
  const Reconstruction reference = ReadModel(gt);
  Reconstruction estimate = Perturbed(reference, 5e-3, 0.01, 1, 9);
  std::vector<Image> all;
  for (const auto& [id, image] : reference.images) all.push_back(image.image);
  estimate.points3D.clear();
  WriteBundler(estimate, folder / "bundle.out", folder / "list.txt", all);
  const PoseEvaluation e =
      EvaluatePoses(PosedCamerasOf(ReadModel(folder / "bundle.out")), PosedCamerasOf(reference));
  ExpectAgreement(
      e, RunScript(gt + " " + (folder / "bundle.out") + " --est-list=" + (folder / "list.txt"),
                   folder));
}

}  // namespace
}  // namespace cairn
