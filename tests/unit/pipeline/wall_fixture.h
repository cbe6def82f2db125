#pragma once

#include <filesystem>

#include "cairn/pipeline/build_pipeline.h"
#include "support/database_dump.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/test_photos.h"

namespace cairn {

// Photographs along a wall, each `step` pixels further on, two of three with depth (or none).
class WallTest : public ::testing::Test {
 protected:
  WallTest(int num_photos, int step, bool with_depth = true)
      : step_(step), with_depth_(with_depth) {
    std::filesystem::create_directories(Images());
    std::filesystem::create_directories(folder_ / "depth");
    for (int i = 0; i < num_photos; ++i) AddPhoto(i);
  }
  std::string Images() const { return folder_ / "images"; }
  void AddPhoto(int i) {
    const std::string name = "photo" + std::to_string(i) + ".png";
    WriteBitmap(Images() + "/" + name, WallPhoto(160, 120, step_ * i));
    if (!with_depth_ || i % 3 == 2) return;
    WriteNpy(folder_ / ("depth/" + name + ".npy"), 16, 12,
             std::vector<float>(16 * 12, 2.0f + 0.1f * i));
  }
  BuildPipelineOptions Options(const std::string& database) const {
    BuildPipelineOptions options;
    options.inputs.image_path = Images();
    options.inputs.database_path = folder_ / database;
    options.inputs.depth_path = folder_ / "depth";
    options.features.type = FeatureType::kSift;
    options.features.first_octave = 0;
    options.verification.max_iterations = 200;
    return options;
  }
  std::string Dump(const std::string& database) const { return DumpDatabase(folder_ / database); }

  TempFolder folder_;

 private:
  const int step_;
  const bool with_depth_;
};

}  // namespace cairn
