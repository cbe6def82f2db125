#pragma once

#include <gtest/gtest.h>

#include <string>

#include "cairn/database/database.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/synthetic/scene.h"
#include "support/synthetic_reconstruction.h"

namespace cairn {

inline SceneOptions SmallScene() {
  SceneOptions options;
  options.num_images = 10;
  options.num_points = 600;
  options.max_keypoints = 400;
  options.image_noise_px = 0.3;
  options.outlier_ratio = 0.1;
  return options;
}

inline Database MakeDatabase(const SyntheticScene& scene) {
  Database database(":memory:");
  WriteScene(scene, SceneContent::kTwoViewGeometries, database);
  return database;
}

using testing_support::kOneThread;

inline ReconstructResult Reconstruct(const Database& database,
                                     const ReconstructSettings& settings = {}) {
  return Reconstruct(database, "", settings, kOneThread);
}

inline const StageReport* FindStage(const RunReport& report, const std::string& name) {
  for (const StageReport& stage : report.stages) {
    if (stage.name == name) return &stage;
  }
  return nullptr;
}

inline double Value(const StageReport& stage, const std::string& key) {
  for (const auto& [name, value] : stage.values) {
    if (name == key) return value;
  }
  ADD_FAILURE() << stage.name << " has no value " << key;
  return 0;
}

}  // namespace cairn
