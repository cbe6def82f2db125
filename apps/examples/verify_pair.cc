// The relative pose of two photographs from matches with affine frames. usage: verify_pair FILE
// The file begins with both cameras, `width height focal_px`. Then every match is two lines, one an
// image: `x y a11 a12 a21 a22`, the position and the frame's matrix (columns: its axes), in pixels.
#include "cairn/two_view/verify_pair.h"

#include <fstream>
#include <iostream>

int main(int argc, char** argv) try {
  std::ifstream file(argc == 2 ? argv[1] : "");
  cairn::Camera cameras[2];
  for (int k = 0; k < 2; ++k) {
    double w = 0, h = 0, f = 0;
    file >> w >> h >> f;
    cameras[k] = cairn::Camera::FromFocal(k + 1, cairn::CameraModel::kPinhole, f, int(w), int(h));
    cameras[k].has_prior_focal_length = true;  // false: a guess, which the matches may overrule
  }
  std::vector<Eigen::Vector2d> points[2];
  std::vector<Eigen::Matrix2d> frames[2];
  Eigen::Vector2d x;
  Eigen::Matrix2d A;
  for (int k = 0; file >> x(0) >> x(1) >> A(0, 0) >> A(0, 1) >> A(1, 0) >> A(1, 1); k = 1 - k) {
    points[k].push_back(x);
    frames[k].push_back(A);
  }
  const cairn::PairReport report =
      cairn::VerifyPair({cameras[0], points[0], frames[0]}, {cameras[1], points[1], frames[1]});
  if (!report.geometry.cam2_from_cam1) {
    std::cerr << "no pose: " << cairn::PairStatusName(report.status) << "\n";
    return 1;
  }
  // x_2 = R x_1 + t of a point in the frames of the two cameras; t has length 1.
  std::cout << cairn::TwoViewConfigName(report.geometry.config) << ", " << report.num_inliers
            << " inliers\nR\n"
            << report.geometry.cam2_from_cam1->RotationMatrix() << "\nt\n"
            << report.geometry.cam2_from_cam1->translation.transpose() << "\n";
} catch (const std::exception& error) {  // ConfigError: what is wrong with the input
  std::cerr << error.what() << "\n";
  return 2;
}
