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

// Images that make a group.
inline constexpr int kMinGroup = 3;
// Comparable points that two images must have, for the pair to tell.
inline constexpr int kMinComparable = 30;

// Of all images of a model, ascending by id.
struct Views {
  std::vector<image_t> ids;
  std::vector<View> views;

  // Indices of the two; nullopt: not both are in the model.
  std::optional<std::pair<int, int>> Find(image_t id1, image_t id2) const;
};
Views MakeViews(const Reconstruction& model, int num_threads);

// A point of an image where another should see it.
struct Expected {
  int cell = 0;         // of the other image
  double distance = 0;  // from its camera
};
// None where the point is outside of `b`, or looks another way from there: directions or distances
// differ.
std::optional<Expected> ExpectIn(const View& b, const View& a, const Eigen::Vector3d& xyz);

}  // namespace cairn
