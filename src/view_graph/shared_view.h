#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// A registered image, ready to be compared with others: which of its points should they see, too?
struct View {
  const RegisteredImage* image = nullptr;
  const Camera* camera = nullptr;
  Eigen::Vector3d center;
  int columns = 0;
  int rows = 0;
  std::vector<point3D_t> seen;                                 // all of its points, ascending
  std::vector<std::pair<point3D_t, Eigen::Vector3d>> samples;  // at most 400 of them
  std::vector<int> present;                                    // points in each cell
  std::vector<double> farthest;                                // distance of those in each cell

  // Row by row; -1: outside of the picture.
  int CellOf(const Eigen::Vector2d& pixel) const;
  bool Sees(point3D_t id) const;
};

View MakeView(const Reconstruction& model, const RegisteredImage& image);

// A point of an image where another should see it.
struct Expected {
  int cell = 0;         // of the other image
  double distance = 0;  // from its camera
};
// None where the point is outside of `b`, or looks another way from there: directions or distances
// differ.
std::optional<Expected> ExpectIn(const View& b, const View& a, const Eigen::Vector3d& xyz);

}  // namespace cairn
