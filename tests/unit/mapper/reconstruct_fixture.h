#pragma once

#include <string>

#include "cairn/database/database.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/synthetic/scene.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"

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

// What change(image_id1, image_id2, geometry) makes of each verified pair.
template <class Change>
void ChangeGeometries(Database& database, const Change& change) {
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    TwoViewGeometry geometry = database.ReadTwoViewGeometry(pair_id).value();
    change(id1, id2, geometry);
    database.WriteTwoViewGeometry(pair_id, geometry);
  }
}

inline void MakePanoramic(TwoViewGeometry& geometry) {
  geometry.config = TwoViewConfig::kPanoramic;
  geometry.cam2_from_cam1.reset();
  geometry.E = geometry.F = std::nullopt;
}

// As of our own verification: it is not improved.
inline void WriteWinner(image_pair_t pair_id, const std::string& verifier, Database& database) {
  PairMetrics metrics;
  metrics.pair_id = pair_id;
  metrics.verifier = metrics.step = verifier;
  metrics.is_winner = true;
  database.WritePairMetrics(metrics);
}

// Image `id` with its keypoints where move(position) puts them.
template <class Move>
void MoveKeypoints(const SyntheticScene& scene, image_t id, Database& database, const Move& move) {
  std::vector<Keypoint> keypoints = scene.keypoints.at(id);
  for (Keypoint& keypoint : keypoints) {
    const Eigen::Vector2f moved = move(keypoint.Position()).template cast<float>();
    keypoint.x = moved.x();
    keypoint.y = moved.y();
  }
  database.WriteKeypoints(id, keypoints);
}

inline ReconstructResult Reconstruct(const Database& database,
                                     const ReconstructSettings& settings = {}) {
  return Reconstruct(database, "", settings, kOneThread);
}

// Largest distance of a camera from the first.
inline double Extent(const Reconstruction& model) {
  double extent = 0;
  for (const auto& [id, image] : model.images) {
    extent = std::max(extent, (image.cam_from_world.Center() -
                               model.images.begin()->second.cam_from_world.Center())
                                  .norm());
  }
  return extent;
}

inline void ExpectEqual(const Reconstruction& a, const Reconstruction& b) {
  ASSERT_EQ(a.images.size(), b.images.size());
  ASSERT_EQ(a.points3D.size(), b.points3D.size());
  for (const auto& [id, image] : a.images) {
    const RegisteredImage& other = b.images.at(id);
    EXPECT_EQ(image.cam_from_world.rotation.coeffs(), other.cam_from_world.rotation.coeffs());
    EXPECT_EQ(image.cam_from_world.translation, other.cam_from_world.translation);
    EXPECT_EQ(image.point3D_ids, other.point3D_ids);
  }
  for (const auto& [id, point] : a.points3D) EXPECT_EQ(point.xyz, b.points3D.at(id).xyz);
  for (const auto& [id, camera] : a.cameras) EXPECT_EQ(camera.params, b.cameras.at(id).params);
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

// The scene's database, in which focal lengths are guesses, off by a factor.
inline Database MakeDatabaseWithGuesses(const SyntheticScene& scene, double factor) {
  Database database = MakeDatabase(scene);
  for (auto [id, camera] : scene.cameras) {
    camera.SetMeanFocal(factor * camera.MeanFocal());
    camera.has_prior_focal_length = false;
    database.WriteCamera(camera);
  }
  return database;
}

// Focal lengths are the true ones times a factor.
inline void ExpectFocals(const Reconstruction& model, const SyntheticScene& scene, double factor,
                         double tolerance) {
  for (const auto& [id, camera] : model.cameras) {
    EXPECT_NEAR(camera.MeanFocal() / scene.cameras.at(id).MeanFocal(), factor, tolerance);
  }
}

}  // namespace cairn
