#include <filesystem>
#include <fstream>
#include <map>

#include "cairn/database/database.h"
#include "cairn/pipeline/stages.h"
#include "relative_pose_experiments/real_pairs.h"
#include "support/shared_data.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn::experiments {
namespace {

// The eight photographs of one scene with loose matches; bounds are wide.
class RealPairsData : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string folder = SharedDataPath("strecha_29");
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
    std::ofstream pairs(folder_ / "pairs.txt");
    for (int i = 0; i < 8; ++i) {
      for (int j = i + 1; j < 8; ++j) {
        pairs << "Herz-Jesus-P8_000" << i << ".jpg Herz-Jesus-P8_000" << j << ".jpg\n";
      }
    }
    pairs.close();
    options_.database_path = folder_ / "matches.db";
    std::filesystem::copy_file(folder + "/colmap_loose_matches.db", options_.database_path);
    Database database(options_.database_path);
    SampleImageDepth(database, "", {folder + "/depth_good", ""});
    options_.reference_path = folder + "/gt";
    options_.pairs_path = folder_ / "pairs.txt";
  }
  TempFolder folder_;
  RealDataOptions options_;
};

TEST_F(RealPairsData, OneCorrespondenceWithDepthFindsMostPoses) {
  const RealScene scene = LoadRealScene(options_, 20, NullMonitor());
  EXPECT_EQ(scene.pairs.size(), 28u);
  const SingleReport single = RunSingleCorrespondences(scene, 2);
  EXPECT_GT(single.share_within_20_15, 0.1);
  EXPECT_GT(single.share_six_inliers, 0.5);
  const auto results = RunRealPairs(scene, {}, 0, NullMonitor());
  std::map<std::string, int> num_good;
  for (const PairResult& r : results) {
    num_good[r.estimator] += r.errors.rotation_deg < 5 && r.errors.translation_deg < 5;
  }
  for (const std::string& name : kRealEstimators) EXPECT_GE(num_good[name], 20) << name;
}

}  // namespace
}  // namespace cairn::experiments
