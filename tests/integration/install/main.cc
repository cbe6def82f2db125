// Averages four exact rotations and directions, and compares.
#include <cstdio>

#include "cairn/rotation_averaging/rotation_averaging.h"
#include "cairn/translation_averaging/translation_averaging.h"

int main() {
  Eigen::Quaterniond rotations[4];
  Eigen::Vector3d centers[4];
  for (int i = 0; i < 4; ++i) {
    rotations[i] = Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d(1, i, 2).normalized());
    centers[i] = Eigen::Vector3d(i, i * i, i == 3);
  }
  std::vector<cairn::RotationEdge> edges;
  std::vector<cairn::DirectionEdge> directions;
  for (cairn::image_t i = 0; i < 4; ++i) {
    for (cairn::image_t j = i + 1; j < 4; ++j) {
      edges.push_back({i + 1, j + 1, rotations[j] * rotations[i].conjugate()});
      directions.push_back({i + 1, j + 1, centers[j] - centers[i]});
    }
  }
  const auto averaged = cairn::AverageRotations(edges);
  const auto placed = cairn::AverageTranslations(directions, {});
  if (averaged.cam_from_world.size() != 4 || placed.centers.size() != 4) return 1;
  double error = 0;
  for (const auto& edge : edges) {
    error = std::max(error, edge.cam2_from_cam1.angularDistance(
                                averaged.cam_from_world.at(edge.image_id2) *
                                averaged.cam_from_world.at(edge.image_id1).conjugate()));
  }
  for (const auto& edge : directions) {
    const Eigen::Vector3d direction =
        placed.centers.at(edge.image_id2) - placed.centers.at(edge.image_id1);
    error = std::max(error, (direction.normalized() - edge.direction.normalized()).norm());
  }
  std::printf("largest error %g\n", error);
  return error < 1e-3 ? 0 : 1;
}
