// Global rotations from the relative ones of a 1DSfM data set.
// usage: average_rotations EGs.txt ROTATIONS.txt
// Writes a line an image: its index, and the 9 numbers of cam_from_world, row by row.
#include <fstream>
#include <iostream>
#include <limits>

#include "cairn/io/one_dsfm.h"
#include "cairn/rotation_averaging/rotation_averaging.h"

int main(int argc, char** argv) try {
  if (argc != 3) throw std::runtime_error("usage: average_rotations EGs.txt ROTATIONS.txt");
  std::vector<cairn::RotationEdge> edges;
  for (const auto& edge : cairn::ReadOneDsfmEdges(argv[1], std::numeric_limits<int>::max())) {
    // x_j = R x_i: ids may be any numbers, and edges may come in any order.
    edges.push_back({static_cast<cairn::image_t>(edge.i), static_cast<cairn::image_t>(edge.j),
                     edge.cam_j_from_cam_i.rotation});
  }
  const cairn::RotationAveragingReport report = cairn::AverageRotations(edges);
  std::cout << RotationAveragingStatusName(report.status) << ": " << report.cam_from_world.size()
            << " rotations, median residual " << report.median_residual_deg << " degrees, "
            << report.num_rejected << " of " << edges.size() << " edges rejected\n";
  std::ofstream file(argv[2]);
  for (const auto& [image_id, rotation] : report.cam_from_world) {
    const Eigen::Matrix3d R = rotation.toRotationMatrix();
    const Eigen::IOFormat row(Eigen::FullPrecision, Eigen::DontAlignCols, " ", " ");
    file << image_id << " " << R.format(row) << "\n";
  }
  return report.cam_from_world.empty() ? 1 : 0;
} catch (const std::exception& error) {  // IoError: a file that is absent or broken, with its line
  std::cerr << error.what() << "\n";
  return 2;
}
