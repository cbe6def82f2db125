#include "relative_pose_experiments/synthetic_scene.h"

#include <filesystem>

#include "cairn/base/file.h"
#include "cairn/database/database.h"
#include "cairn/io/colmap_model.h"
#include "cairn/synthetic/scene.h"

namespace cairn::experiments {

RealDataOptions WriteSyntheticScene(const std::string& folder, bool quick, uint64_t seed) {
  SceneOptions options;
  options.num_images = quick ? 8 : 24;
  options.num_points = 1500;
  options.max_keypoints = 600;
  options.image_noise_px = 0.3;
  options.affine_noise = 0.15;
  options.depth_noise = 0.1;
  options.depth_gradient_noise = 0.2;
  options.missing_depth_ratio = 0.05;
  options.outlier_ratio = 0.6;

  RealDataOptions data;
  data.scene = "synthetic";
  data.depth_name = "simulated";
  data.database_path = folder + "/synthetic/scene.db";
  data.reference_path = folder + "/synthetic/truth";
  CreateFolders(folder + "/synthetic");
  for (const char* suffix : {"", "-wal", "-shm"}) {  // of an earlier run
    std::filesystem::remove(data.database_path + suffix);
  }
  const SyntheticScene scene = MakeScene(options, seed);
  Database database(data.database_path);
  WriteScene(scene, SceneContent::kMatches, database);
  WriteColmapModel(scene.truth, data.reference_path);
  return data;
}

}  // namespace cairn::experiments
