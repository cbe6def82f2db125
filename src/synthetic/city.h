#pragma once

#include <cstdint>

#include "cairn/geometry/rigid3d.h"

namespace cairn {

// Where CameraLayout::kCity has its places: a tower each, on a grid of streets, with the images
// around them, which see the towers behind, too. Places are turned about the vertical, and each but
// perhaps the last has a twin far away, which looks alike in a part of its surface.
class City {
 public:
  // Of the elements of a place, every one whose number within the place this divides is that of its
  // twin, too.
  static constexpr int kAlikeEvery = 5;

  explicit City(int64_t num_images);

  int NumPlaces() const { return num_places_; }
  int PlaceOf(int64_t image) const { return static_cast<int>(image % num_places_); }
  Rigid3d WorldFromPlace(int place) const;
  // The same place or one at most a diagonal away.
  bool AreNeighbors(int place1, int place2) const;
  // Itself: there is none.
  int TwinOf(int place) const;
  bool HasTwins() const;
  // Takes a place, in the world, to one that looks like it.
  Rigid3d Motion(int from, int to) const;

 private:
  int num_places_;
  int width_;  // places a row
};

}  // namespace cairn
