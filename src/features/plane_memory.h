#pragma once

#include <cstddef>
#include <memory>

namespace cairn {

// Floats of a plane, not set to anything. What takes megabytes is of large pages, where the system
// has them: to map and clear a pyramid by pages of 4 kB takes as long as to blur it.
std::shared_ptr<float[]> AllocateFloats(size_t n);

// While one lives, the large pages of planes that end wait for planes of the same size, those of
// the next image: to clear them takes a fifth of the time of features. There are never more than
// were in use at once.
class PlaneReuse {
 public:
  PlaneReuse();
  ~PlaneReuse();
  PlaneReuse(const PlaneReuse&) = delete;
  PlaneReuse& operator=(const PlaneReuse&) = delete;
};

}  // namespace cairn
